// Writing a file so that no half of it is ever seen under its name.
#pragma once

#include <filesystem>
#include <string_view>

namespace lsp::sample {

// Writes `bytes` to a temporary file beside `path`, syncs it and renames it to `path`. On failure throws
// lsp::Failure (Exit::kFile), removes the temporary and leaves an older file at `path` as it was.
void write_file(const std::filesystem::path& path, std::string_view bytes);

}  // namespace lsp::sample
