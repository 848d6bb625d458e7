// What the fuzzers of the format share: rays, and a mutator that repairs hashes.
#pragma once

#include <lsp/lsp.h>

#include <cstddef>
#include <cstdint>

#include "aligned_bytes.h"
#include "check.h"

namespace lsp::fuzz {

// What a packed file may unfold to here: a fuzzer's process is not to be killed for its memory.
inline constexpr uint64_t kMemoryLimit = uint64_t{1} << 26;

using corpus::AlignedBytes;

// Traces `count` rays derived from `seed` in every mode that the scene allows. Ends the process when a hit
// makes no sense: not ahead, of no primitive of a validated file, or left incomplete.
void trace_rays(const lsp_scene& scene, uint64_t seed, size_t count, bool validated);

// Ends the process with a message: the finding that libFuzzer keeps.
[[noreturn]] void found(const char* what);

}  // namespace lsp::fuzz
