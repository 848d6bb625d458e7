// Baked files that several tests share.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace lsp::bench {

// The bake of `input` with `options` in `directory`, made by the lsp-bake beside this program unless one
// newer than both lies there. Safe to call from several processes at once. Throws Failure.
std::filesystem::path shared_bake(const std::filesystem::path& input, const std::vector<std::string>& options,
                                  const std::filesystem::path& directory);

}  // namespace lsp::bench
