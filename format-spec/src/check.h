// Checks an .lsp file in memory against the rule catalogue.
//
// The bytes may be hostile. No count, offset or size of the file is used before it was checked against the
// bytes that are there; memory used beyond the file is at most `memory_limit` for unpacked sections, some 30
// bytes a node of a damaged tree, 16 a wide node, some 20 bytes a triangle of an NTree and, at the level
// geometry, some 30 bytes a triangle and a node of an NTree; four to 32 bytes a cell of a grid of cells.
// Nothing is written, no thread is started. Time is proportional to the file's size.
#pragma once

#include <lsp/sections.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "hash.h"
#include "report.h"

namespace lsp::format {

enum class Level {
  kContainer,  // identification, header, section table, hashes, codec, metadata
  kStructure,  // and the tree, Line Spaces, bitsets, candidates: all that a tracer's indices follow
  kGeometry,   // and every triangle, normal, material and box
};

struct CheckOptions {
  Level level = Level::kStructure;
  uint64_t memory_limit = uint64_t{8} << 30;     // for the unpacked sections of a packed file
  uint32_t examples_per_rule = 4;                // how many findings of a rule are kept in full
  std::optional<Hash128> source = std::nullopt;  // hash of the source files to compare with, see hash.h
};

Report check_file(std::span<const std::byte> bytes, const CheckOptions& options = {});

// By kind what a section holds, 16-byte aligned; empty: no section.
using Contents = std::array<std::span<const std::byte>, kKinds>;

// The same of what is to become a file, at least at the level structure. Nothing is asked of what a place in
// a file decides: magic numbers, offsets, lengths, hashes and metadata.
Report check_contents(const LspHeader& header, const Contents& contents, const CheckOptions& options = {});

}  // namespace lsp::format
