// Reading whole input files.
#pragma once

#include <filesystem>
#include <string>

#include "import/budget.h"

namespace lsp {

// The bytes of a regular file, charged to the budget. Throws Failure kFile where it cannot be read or is no
// regular file (a pipe or device could be endless), kLimit by the budget.
std::string read_file(const std::filesystem::path& path, Budget& budget);

// The same for text: a byte order mark is dropped and UTF-16, with or without a mark, becomes UTF-8.
std::string read_text(const std::filesystem::path& path, Budget& budget);

// `text` with every byte that is not part of well-formed UTF-8 replaced by '?', so that names out of a file
// may go into reports.
std::string printable(std::string_view text);

// The text with a question mark for every byte that is no part of a UTF-8 character.
std::string valid_utf8(std::string_view text);

}  // namespace lsp
