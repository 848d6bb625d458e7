// The octahedral form of unit normals: Cigolle et al., "A Survey of Efficient Representations for
// Independent Unit Vectors", JCGT 2014.
#pragma once

#include <lsp/layout.h>

#include <cstdint>

namespace lsp::format {

// The unit normal nearest to the direction n, which must be finite and not zero.
uint32_t encode_normal(const lsp_float3& n);

// Whether both halves lie in [-32767, 32767]; -32768 would stand for a component below -1.
inline bool normal_sound(uint32_t packed) { return (packed & 0xFFFFu) != 0x8000u && packed >> 16 != 0x8000u; }

}  // namespace lsp::format
