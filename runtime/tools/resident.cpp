#include "resident.h"

#include <cinttypes>
#include <cstdio>
#include <fstream>
#include <string>

namespace lsp {

uint64_t resident_bytes(const void* address) {
  const auto wanted = reinterpret_cast<uintptr_t>(address);
  std::ifstream maps("/proc/self/smaps");
  bool inside = false;
  for (std::string line; std::getline(maps, line);) {
    uint64_t first = 0;
    uint64_t last = 0;
    uint64_t kib = 0;
    if (sscanf(line.c_str(), "%" SCNx64 "-%" SCNx64 " ", &first, &last) == 2) {
      inside = wanted >= first && wanted < last;
    } else if (inside && sscanf(line.c_str(), "Rss: %" SCNu64 " kB", &kib) == 1) {
      return kib * 1024;
    }
  }
  return 0;
}

}  // namespace lsp
