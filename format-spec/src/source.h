// The hash of the files that a bake was made from.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>

#include "hash.h"

namespace lsp::format {

// XXH3-128 of the bytes of each input in the order given, each followed by the files beside it that the META
// of the baked file lists for it; of these one that is not there adds nothing, and the hash is another.
// `baked`, an .lsp file's bytes, may be hostile or empty. Throws Failure kFile where a file cannot be read.
Hash128 hash_sources(std::span<const std::filesystem::path> inputs, std::span<const std::byte> baked);

}  // namespace lsp::format
