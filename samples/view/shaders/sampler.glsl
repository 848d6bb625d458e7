/* Owen-scrambled Sobol points, those of samples/render/sampler.h: both halves of the window draw the same random
 * numbers, so that they differ by the approximation alone. */
uint hash_mix(uint x) {
  x ^= x >> 16;
  x *= 0x21F0AAADu;
  x ^= x >> 15;
  x *= 0xD35A2D97u;
  x ^= x >> 15;
  return x;
}

uint hash_combine(uint seed, uint value) { return hash_mix(seed ^ (value + 0x9E3779B9u + (seed << 6) + (seed >> 2))); }

uint owen_scramble(uint x, uint seed) {
  x = bitfieldReverse(x);
  x ^= x * 0x3D20ADEAu;
  x += seed;
  x *= (seed >> 16) | 1u;
  x ^= x * 0x05526C56u;
  x ^= x * 0x53A22864u;
  return bitfieldReverse(x);
}

vec2 sobol_point(uint index, uint seed) {
  uint shuffled = owen_scramble(index, hash_combine(seed, 0xB5297A4Du));
  uint y = 0u;
  uint direction = 0x80000000u;
  for (uint i = shuffled; i != 0u; i >>= 1, direction ^= direction >> 1) {
    if ((i & 1u) != 0u) y ^= direction;
  }
  uint x = owen_scramble(bitfieldReverse(shuffled), hash_combine(seed, 1u));
  y = owen_scramble(y, hash_combine(seed, 2u));
  return vec2(float(x >> 8), float(y >> 8)) / 16777216.0;
}
