// Bakes that an earlier run of the benchmark left behind, told apart by everything that decides their bytes.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "report.h"

namespace lsp::bench {

// What a bake depends on, as a hash: the lsp-bake program's own bytes, the input's, the options, and for
// formats that refer to other files (.obj, .gltf) name, size and time of every file beside the input. Throws
// Failure(kFile) where the input cannot be read.
std::string bake_key(const std::filesystem::path& program, const std::filesystem::path& input,
                     const std::vector<std::string>& options);

// The record beside a bake, `bake` + ".json", if it is of that very key and the bake is still whole; else
// null. A record holds "key", "file_bytes" and whatever remember_bake was given.
Json find_bake(const std::filesystem::path& bake, const std::string& key);

// Writes the record of a finished bake.
void remember_bake(const std::filesystem::path& bake, const std::string& key, Json record);

}  // namespace lsp::bench
