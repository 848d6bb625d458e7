// The demo's page and its summary in plain text.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace lsp::sample {

// What the programs printed with --json. Functions below throw nlohmann::json::exception where a figure is
// missing.
struct Figures {
  std::string title;
  std::optional<double> validate_seconds;  // nothing: not measured
  nlohmann::json bake;
  nlohmann::json exact;
  nlohmann::json approximate;
  nlohmann::json compare;
  // Of cells: a smaller picture at settings of the dial, what lsp-render and lsp-compare printed, and its
  // exact one; null where there are none.
  struct Setting {
    std::string name;
    nlohmann::json approximate;
    nlohmann::json compare;
  };
  std::vector<Setting> curve;
  nlohmann::json curve_exact;
};

// PNG files' bytes.
struct Pictures {
  std::string exact;
  std::string approximate;
  std::string difference;
};

// A page that needs no other file and no network.
std::string make_page(const Figures& figures, const Pictures& pictures);
// The same figures in a few lines.
std::string make_summary(const Figures& figures);

}  // namespace lsp::sample
