// How much of a mapping this process has paged in.
#pragma once

#include <cstdint>

namespace lsp {

// Bytes of the mapping that starts at `address` that are in this process' memory (Rss in /proc/self/smaps);
// 0 where the system does not say.
uint64_t resident_bytes(const void* address);

}  // namespace lsp
