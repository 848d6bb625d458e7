#include "closed_ways.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "../random.h"
#include "../vectors.h"
#include "lsp/lsp.h"

namespace lsp {
namespace {

constexpr uint32_t kPerWay = 16;      // rays of each way that are asked for, on average
constexpr uint32_t kEyes = 1u << 14;  // that look at once
constexpr uint32_t kMostEyes = 1u << 22;
constexpr uint32_t kEyesForRay = 32;  // at most, for a ray that is wanted: of needles hardly an eye sees one
constexpr uint32_t kPerPoint = 4;     // rays from what each sees
constexpr size_t kPart = 1024;        // traced at once
constexpr float kOffset = 1e-4f;      // of the diagonal, of a ray's beginning from the surface
constexpr uint64_t kSeed = uint64_t{1} << 42;

// A way by which less than one ray in so many leaves the scene is closed.
constexpr uint32_t kOneIn = 8;

struct Way {
  uint32_t rays = 0, left = 0;  // that begin in the cell, and of these that leave the scene
};

class Ways {
 public:
  explicit Ways(const Baked& baked)
      : header_(baked.header),
        words_(baked.cell_grid.words),
        scene_(view(baked)),
        offset_(kOffset * glm::length(vec(header_.bounds_max) - vec(header_.bounds_min))),
        ways_(baked.cell_tables.cells.size()) {}

  // Counts the rays from what `count` eyes from number `first` on see, and returns their number.
  uint64_t look(uint32_t first, uint32_t count) {
    trace(first, count);
    for (size_t i = 0; i < rays_.size(); ++i) add(rays_[i], !(hits_[i].t < INFINITY));
    return rays_.size();
  }

  uint32_t closed(size_t cell) const {
    uint32_t bits = 0;
    for (uint32_t w = 0; w < LSP_WAYS; ++w)
      if (kOneIn * ways_[cell][w].left < std::max(1u, ways_[cell][w].rays)) bits |= 1u << w;
    return bits;
  }

 private:
  // What `count` eyes from number `first` on see, and rays from there.
  void trace(uint32_t first, uint32_t count) {
    std::vector<std::vector<LspRay>> parts((count + kPart - 1) / kPart);
    std::vector<std::vector<LspHit>> hits(parts.size());
    tbb::parallel_for(size_t(0), parts.size(), [&](size_t p) {
      const auto begin = uint32_t(p * kPart);
      parts[p] = rays_from_seen(first + begin, std::min(uint32_t(kPart), count - begin));
      hits[p] = traced(LSP_TRACE_OCCLUSION, parts[p]);
    });
    rays_.clear();
    hits_.clear();
    for (size_t p = 0; p < parts.size(); ++p) {
      rays_.insert(rays_.end(), parts[p].begin(), parts[p].end());
      hits_.insert(hits_.end(), hits[p].begin(), hits[p].end());
    }
  }

  std::vector<LspHit> traced(uint32_t flags, const std::vector<LspRay>& rays) const {
    std::vector<LspHit> hits(rays.size());
    const lsp_trace_options options = {flags, 0, 0, 0};
    if (!rays.empty()) lsp_trace(&scene_, &options, rays.data(), hits.data(), rays.size(), nullptr, nullptr);
    return hits;
  }

  std::vector<LspRay> rays_from_seen(uint32_t first, uint32_t count) const {
    const glm::vec3 lo = vec(header_.bounds_min), extent = vec(header_.bounds_max) - lo;
    std::vector<LspRay> looks, rays;
    for (uint64_t i = kSeed + first; i < kSeed + first + count; ++i) {
      const glm::vec3 share(float(random(i, 0)), float(random(i, 1)), float(random(i, 2)));
      looks.push_back({f3(lo + extent * share), 0, f3(random_on_sphere(i, 3)), INFINITY});
    }
    std::vector<LspRay> glances = looks;
    for (size_t i = 0; i < looks.size(); ++i)
      glances[i].direction = f3(random_on_sphere(kSeed + first + i, 40));
    const std::vector<LspHit> seen = traced(0, looks), beside = traced(0, glances);
    for (size_t i = 0; i < seen.size(); ++i) {
      if (seen[i].primitive == LSP_NONE) continue;
      const glm::vec3 d = vec(looks[i].direction);
      glm::vec3 n = vec(seen[i].normal);
      if (glm::dot(n, d) > 0) {
        // From within a closed object nobody sees it, but rooms show backs, too.
        if (beside[i].primitive == LSP_NONE || glm::dot(vec(beside[i].normal), vec(glances[i].direction)) > 0)
          continue;
        n = -n;
      }
      const glm::vec3 origin = vec(looks[i].origin) + d * seen[i].t + n * offset_;
      for (uint32_t k = 0; k < kPerPoint; ++k) {
        const uint64_t number = (kSeed + first + i) * kPerPoint + k;
        const glm::dvec3 way = glm::dvec3(n) * (1 + 1e-9) + random_on_sphere(number, 70);
        rays.push_back({f3(origin), 0, f3(glm::normalize(way)), INFINITY});
      }
    }
    return rays;
  }

  // Counts a ray to the way by which it leaves the cell that it begins in, as lsp_begin finds it.
  void add(const LspRay& ray, bool leaves) {
    const LspCellGrid& g = header_.cells;
    const glm::vec3 p = (vec(ray.origin) - vec(g.lo)) * g.per_size, d = vec(ray.direction) * g.per_size;
    const glm::ivec3 dims(int(g.cells_x), int(g.cells_y), int(g.cells_z)), cell = glm::floor(p);
    for (int k = 0; k < 3; ++k)
      if (cell[k] < 0 || cell[k] >= dims[k]) return;
    const uint32_t word = words_[size_t((cell.z * dims.y + cell.y) * dims.x + cell.x)];
    if ((word & LSP_CELL_FILLED) == 0) return;
    int axis = 0;
    float t = INFINITY;
    for (int k = 0; k < 3; ++k) {
      if (d[k] == 0) continue;
      const float side = (float(cell[k] + (d[k] > 0 ? 1 : 0)) - p[k]) / d[k];
      if (side < t) {
        t = side;
        axis = k;
      }
    }
    const glm::vec3 to = p + d * t - glm::vec3(cell);
    const auto patch = [&](int k) {
      return std::min(uint32_t(std::max(0.0f, to[k]) * float(g.origin_patches)), g.origin_patches - 1);
    };
    const uint32_t face = 2 * uint32_t(axis) + (d[axis] > 0 ? 1 : 0);
    const uint32_t quarter =
        LSP_QUARTER(patch(axis == 0 ? 1 : 0), patch(axis == 2 ? 1 : 2), g.origin_patches);
    Way& way = ways_[word & ~LSP_CELL_FILLED][LSP_WAY(face, quarter)];
    ++way.rays;
    way.left += leaves ? 1 : 0;
  }

  const LspHeader& header_;
  const std::vector<uint32_t>& words_;
  const lsp_scene scene_;
  const float offset_;
  std::vector<std::array<Way, LSP_WAYS>> ways_;
  std::vector<LspRay> rays_;
  std::vector<LspHit> hits_;
};

}  // namespace

void find_closed_ways(Baked& baked) {
  if (baked.cell_tables.references.empty()) return;
  Ways ways(baked);
  const uint64_t wanted = uint64_t{kPerWay} * LSP_WAYS * baked.cell_tables.cells.size();
  uint64_t rays = 0;
  const auto eyes = uint32_t(std::min<uint64_t>(kMostEyes, kEyesForRay * wanted));
  for (uint32_t first = 0; first < eyes && rays < wanted; first += kEyes) rays += ways.look(first, kEyes);
  for (size_t i = 0; i < baked.cell_tables.cells.size(); ++i)
    baked.cell_tables.cells[i].closed = ways.closed(i);
}

}  // namespace lsp
