// The URIs by which glTF documents name what lies beside them.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "import/text.h"

namespace lsp {

inline bool is_data_uri(std::string_view uri) { return equals_ignoring_case(uri.substr(0, 5), "data:"); }

// The bytes of a data URI, in base64 or percent codes. Throws Failure kInvalid, naming `file`, where they are
// no such.
std::string decode_data_uri(const std::string& file, std::string_view uri);

// The file that a URI names, relative to the folder of `document`. Beside what the standard says (percent
// codes), what exporters write: unencoded names with percent signs, backslashes, queries, and what
// find_file() finds. In `remark`, empty where the standard led to the file, what did.
std::filesystem::path resolve_uri(const std::filesystem::path& document, std::string_view uri,
                                  std::string& remark);

}  // namespace lsp
