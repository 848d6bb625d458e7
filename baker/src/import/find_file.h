// Files that meshes name.
#pragma once

#include <filesystem>
#include <string>

namespace lsp {

// The file that is meant by a name relative to `folder`: by that name, or with backslashes for slashes. Then,
// with `guessed` true, beside the mesh, as exporters write paths of their own machine, and in any case, as it
// is found where file systems do not mind. Empty where there is none.
std::filesystem::path find_file(const std::filesystem::path& folder, std::string name, bool& guessed);

// Where the file should be, for one that is not found.
std::filesystem::path path_beside(const std::filesystem::path& folder, std::string name);

}  // namespace lsp
