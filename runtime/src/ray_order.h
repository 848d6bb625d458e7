// Rays in the order of where they begin, for loops that take many down a tree together.
#pragma once

#include <cstdint>

#include "lsp/lsp.h"

namespace lsp {

constexpr uint32_t kMostOrdered = 4096;

// Writes the numbers of rays[0, count), at most kMostOrdered and at least one, to order[0, count): along a
// Morton curve through a grid of cells around their origins, up to 16^3 of them, and within a cell as they
// were. Rays may be invalid.
void order_by_origin(const LspRay* rays, uint32_t count, uint16_t* order);

}  // namespace lsp
