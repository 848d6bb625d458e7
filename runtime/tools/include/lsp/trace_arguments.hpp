// The options that say how approximate rays are answered, for the programs that have them. Links CLI11; not
// installed.
#pragma once

#include <algorithm>
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "lsp/lsp.h"

namespace lsp {

struct TraceArguments {
  std::string near = "exact";
  float lod = 0;
  std::string quality;  // empty: balanced
  float max_loss = -1;  // negative: the quality's

  std::string quality_name() const { return quality.empty() ? "balanced" : quality; }
};

inline void add_trace_arguments(CLI::App& app, TraceArguments& a) {
  app.add_option(
         "--near", a.near,
         "Approximate: how to answer where a Line Space's node holds the ray's origin (default exact)")
      ->check(CLI::IsMember({"exact", "skip", "approximate"}));
  app.add_option(
         "--lod", a.lod,
         "Approximate: stop at a Line Space once its diagonal is under LOD times the distance (default "
         "0: only at the deepest)")
      ->check(CLI::Range(0.0f, 1e6f));
  app.add_option(
         "--quality", a.quality,
         "Approximate, cells: fast, balanced (default) or accurate, the points of the dial that the bake "
         "measured and the file states")
      ->check(CLI::IsMember({"fast", "balanced", "accurate"}));
  app.add_option(
         "--max-loss", a.max_loss,
         "Approximate, cells: trace exactly where answers lose more, in per cent; 100: tables alone, 0: "
         "every cell exactly (default: as --quality says)")
      ->check(CLI::Range(0.0f, 100.0f));
}

inline lsp_trace_options to_trace_options(const TraceArguments& a, bool approximate) {
  lsp_trace_options options{};
  if (!approximate) return options;
  options.flags = LSP_TRACE_APPROXIMATE;
  if (a.near == "approximate") options.flags |= LSP_TRACE_NEAR_APPROXIMATE;
  if (a.near == "skip") options.flags |= LSP_TRACE_NEAR_SKIP;
  options.lod = a.lod;
  options.quality = a.quality == "fast"       ? LSP_QUALITY_FAST
                    : a.quality == "accurate" ? LSP_QUALITY_ACCURATE
                                              : LSP_QUALITY_BALANCED;
  if (a.max_loss >= 0) {
    options.flags |= LSP_TRACE_MAX_LOSS;
    options.max_loss = a.max_loss;
  }
  return options;
}

// What of the options has no meaning for a file with this header, a sentence each: to be said, not ignored in
// silence.
inline std::vector<std::string> unused_arguments(const TraceArguments& a, bool approximate,
                                                 const LspHeader& header) {
  const bool cells = (header.required_features & LSP_FEATURE_CELLS) != 0;
  const bool tables = cells || (header.required_features & LSP_FEATURE_LINE_SPACES) != 0;
  std::vector<std::string> notes;
  const auto note = [&](bool given, const char* option, bool cells_have_it) {
    if (!given || (approximate && cells == cells_have_it)) return;
    notes.push_back(std::string(option) + " does nothing: " +
                    (!approximate ? "rays are exact"
                     : cells      ? "the file has cells, see --quality"
                     : tables     ? "the file has no cells"
                                  : "the file has no tables, every ray is answered exactly"));
  };
  note(a.near != "exact", "--near", false);
  note(a.lod > 0, "--lod", false);
  note(!a.quality.empty(), "--quality", true);
  note(a.max_loss >= 0, "--max-loss", true);
  if (approximate && cells && !a.quality.empty() && a.max_loss >= 0)
    notes.push_back("--quality does nothing: --max-loss sets the dial");
  return notes;
}

// The same of several files: what has no meaning for any of them.
inline std::vector<std::string> unused_arguments(const TraceArguments& a, bool approximate,
                                                 const std::vector<const LspHeader*>& headers) {
  std::vector<std::string> notes;
  for (const LspHeader* header : headers) {
    const std::vector<std::string> here = unused_arguments(a, approximate, *header);
    if (header == headers.front()) notes = here;
    std::erase_if(notes, [&](const auto& n) { return std::find(here.begin(), here.end(), n) == here.end(); });
  }
  return notes;
}

}  // namespace lsp
