// What META says of the qualities of cells, in words.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace lsp::format {

// A line for each of "fast", "balanced" and "accurate" that `qualities` of META has. Hostile: what is no
// number is "?".
std::string qualities_text(const nlohmann::ordered_json& qualities);

}  // namespace lsp::format
