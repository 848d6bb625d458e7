#pragma once

#include <cstdint>

namespace lsp {

// PCG-RXS-M-XS 32 (O'Neill 2014), twice, as a hash: any number can be made without the ones before it.
inline uint32_t pcg(uint32_t x) {
  for (int i = 0; i < 2; ++i) {
    x = x * 747796405u + 2891336453u;
    x = ((x >> ((x >> 28) + 4)) ^ x) * 277803737u;
    x = (x >> 22) ^ x;
  }
  return x;
}

}  // namespace lsp
