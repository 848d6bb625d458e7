// What a file holds, in numbers: the content of lsp-info.
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>

namespace lsp::format {

// Parameters, sections, sizes, fill rates and a row for every depth of the tree. Reads as much as is sound of
// a damaged file; packed sections are unpacked as long as they fit into memory_limit. Throws Failure:
// kInvalid when this is not an .lsp file at all, kUnsupported when its version or features are not known.
nlohmann::ordered_json summarize(std::span<const std::byte> file, const std::string& name,
                                 uint64_t memory_limit);

// The same for people, from the JSON. `section` is the name of one section to show alone, or empty.
std::string summary_text(const nlohmann::ordered_json& summary, const std::string& section);

}  // namespace lsp::format
