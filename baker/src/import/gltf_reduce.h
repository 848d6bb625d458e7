// A glTF document's JSON, cut down to what the importer reads.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace lsp {

// Geometry and pose alone, with every index and size a whole number. Throws Failure kInvalid, naming `file`,
// where one is not.
nlohmann::json reduce_to_geometry(const std::string& file, const nlohmann::json& document);

// In words: what the document holds beyond what is read, each kind once.
std::vector<std::string> unread_parts(const nlohmann::json& document);

// Throws Failure kUnsupported by name where the document requires an extension that changes geometry and is
// not read.
void check_required_extensions(const std::string& file, const nlohmann::json& document);

}  // namespace lsp
