#include "ray_order.h"

#include <algorithm>

namespace lsp {
namespace {

constexpr uint32_t kMostSide = 16;
constexpr uint32_t side_for(uint32_t rays) { return rays < 256 ? 4 : rays < 1024 ? 8 : kMostSide; }

// Its four bits, every third one.
constexpr uint32_t spread(uint32_t i) { return (i & 1u) | (i & 2u) << 2 | (i & 4u) << 4 | (i & 8u) << 6; }

// Of cells around the rays' origins.
struct Grid {
  uint32_t side;
  lsp_float3 lo, scale;

  Grid(const LspRay* rays, uint32_t count) : side(side_for(count)), lo(rays[0].origin) {
    lsp_float3 hi = lo;
    for (uint32_t i = 1; i < count; ++i) {
      const lsp_float3 o = rays[i].origin;
      lo = {std::min(lo.x, o.x), std::min(lo.y, o.y), std::min(lo.z, o.z)};
      hi = {std::max(hi.x, o.x), std::max(hi.y, o.y), std::max(hi.z, o.z)};
    }
    const auto most = static_cast<float>(side);
    const auto per = [&](float from, float to) { return to > from ? most / (to - from) : 0.0f; };
    scale = {per(lo.x, hi.x), per(lo.y, hi.y), per(lo.z, hi.z)};
  }

  uint32_t cells() const { return side * side * side; }

  // Where it is on the curve.
  uint32_t cell(const lsp_float3& o) const {
    return spread(slice(o.x, lo.x, scale.x)) | spread(slice(o.y, lo.y, scale.y)) << 1 |
           spread(slice(o.z, lo.z, scale.z)) << 2;
  }

  // Along an axis; of a NaN the first.
  uint32_t slice(float at, float from, float per) const {
    const float i = (at - from) * per;
    return i > 0 ? std::min(static_cast<uint32_t>(std::min(i, float{kMostSide})), side - 1) : 0;
  }
};

}  // namespace

void order_by_origin(const LspRay* rays, uint32_t count, uint16_t* order) {
  const Grid grid(rays, count);
  // Of every cell how many rays, then where its rays end, and at last where they begin.
  uint16_t places[kMostSide * kMostSide * kMostSide], cells[kMostOrdered];
  std::fill_n(places, grid.cells(), uint16_t{0});
  for (uint32_t i = 0; i < count; ++i) {
    cells[i] = static_cast<uint16_t>(grid.cell(rays[i].origin));
    ++places[cells[i]];
  }
  uint16_t sum = 0;
  for (uint32_t k = 0; k < grid.cells(); ++k) places[k] = sum = static_cast<uint16_t>(sum + places[k]);
  for (uint32_t i = count; i-- > 0;) order[--places[cells[i]]] = static_cast<uint16_t>(i);
}

}  // namespace lsp
