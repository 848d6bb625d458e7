// The hash of the files that a bake was made from.
#pragma once

#include <filesystem>
#include <span>

#include "hash.h"

namespace lsp::format {

// XXH3-128 of the bytes of each input in the order given and, for a .gltf file, of each of its external
// buffers in buffer order right after it. Throws Failure: kFile where a file cannot be read, kInvalid where a
// .gltf file is not JSON.
Hash128 hash_sources(std::span<const std::filesystem::path> inputs);

}  // namespace lsp::format
