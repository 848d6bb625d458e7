// Owen-scrambled Sobol points, the same for the same pixel, sample and dimension whatever else is rendered:
// an exact and an approximate picture draw the same random numbers, so that they differ by the approximation
// alone. Laine and Karras 2011, Burley 2020 ("Practical Hash-based Owen Scrambling").
#pragma once

#include <cstdint>
#include <glm/glm.hpp>

namespace lsp::sample {

inline uint32_t hash_mix(uint32_t x) {
  x ^= x >> 16;
  x *= 0x21F0AAADu;
  x ^= x >> 15;
  x *= 0xD35A2D97u;
  x ^= x >> 15;
  return x;
}

inline uint32_t hash_combine(uint32_t seed, uint32_t value) {
  return hash_mix(seed ^ (value + 0x9E3779B9u + (seed << 6) + (seed >> 2)));
}

inline uint32_t reverse_bits(uint32_t x) {
  x = (x >> 16) | (x << 16);
  x = ((x & 0x00FF00FFu) << 8) | ((x & 0xFF00FF00u) >> 8);
  x = ((x & 0x0F0F0F0Fu) << 4) | ((x & 0xF0F0F0F0u) >> 4);
  x = ((x & 0x33333333u) << 2) | ((x & 0xCCCCCCCCu) >> 2);
  return ((x & 0x55555555u) << 1) | ((x & 0xAAAAAAAAu) >> 1);
}

// Owen's scramble of the bits of x, from the most significant down.
inline uint32_t owen_scramble(uint32_t x, uint32_t seed) {
  x = reverse_bits(x);
  x ^= x * 0x3D20ADEAu;
  x += seed;
  x *= (seed >> 16) | 1u;
  x ^= x * 0x05526C56u;
  x ^= x * 0x53A22864u;
  return reverse_bits(x);
}

// Point `index` of a two-dimensional sequence chosen by `seed`, in [0, 1)^2.
inline glm::vec2 sobol_point(uint32_t index, uint32_t seed) {
  const uint32_t shuffled = owen_scramble(index, hash_combine(seed, 0xB5297A4Du));
  uint32_t y = 0;
  uint32_t direction = 0x80000000u;
  for (uint32_t i = shuffled; i != 0; i >>= 1, direction ^= direction >> 1) {
    if (i & 1u) y ^= direction;
  }
  const uint32_t x = owen_scramble(reverse_bits(shuffled), hash_combine(seed, 1u));
  y = owen_scramble(y, hash_combine(seed, 2u));
  constexpr float kScale = 1.0f / 16777216.0f;
  return {static_cast<float>(x >> 8) * kScale, static_cast<float>(y >> 8) * kScale};
}

}  // namespace lsp::sample
