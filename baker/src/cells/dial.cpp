#include "dial.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "../surface_rays.h"
#include "../vectors.h"
#include "../view_rays.h"

namespace lsp {
namespace {

constexpr uint32_t kPoints = 2048;         // of either kind
constexpr uint32_t kPerPoint = 16;         // rays
constexpr uint32_t kViews = 12;            // small pictures
constexpr uint32_t kSide = 16;             // of each, in pixels
constexpr uint32_t kCounted = 4;           // of so many points one is counted: it takes three times as long
constexpr double kRadii[] = {0.067, 0.2};  // of ambient occlusion, in diagonals

// What the parts of a ray cost, all in the same unit.
struct Costs {
  double ray, step, look_up, call, cell_node, cell_triangle;
  double exact_ray, wide_node, triangle;

  double cells(const lsp_trace_counts& c) const {
    return ray + (step * double(c.nodes) + look_up * double(c.shafts) + call * double(c.exact) +
                  cell_node * double(c.exact_nodes) + cell_triangle * double(c.triangles)) /
                     double(std::max<uint64_t>(1, c.rays));
  }
  double exact(const lsp_trace_counts& c) const {
    return exact_ray + (wide_node * double(c.nodes) + triangle * double(c.triangles)) /
                           double(std::max<uint64_t>(1, c.rays));
  }
};
// Fitted to the times of the bunny, Sponza's hall and the atrium at seven dials, from tables alone to two
// exact traces a ray: most of them within a tenth. Steps through the grid are cheap, exact traces dear.
constexpr Costs kVulkan = {0, 0.3, 2.7, 3.8, 0.25, 2, 0, 2.8, 1.3};  // lavapipe

// On the CPU what is read waits for memory, the more there is of it. Fitted to the times of 24 meshes, from a
// box to the dragon, at five dials (nanoseconds, AVX-512, two threads): on average 9 % off. In lanes a call
// costs what it visits and nothing to begin with.
Costs cpu_costs(uint64_t exact_bytes) {
  const double doublings = std::clamp(std::log2(std::max(1.0, double(exact_bytes) * 1e-6)), 0.0, 4.0);
  return {5.5, 7, 4.8 + 1.9 * doublings, 0, 6.7, 5.5 + 2.3 * doublings, 16, 19 + 2.8 * doublings, 3.8};
}

// What a point of the dial errs.
struct DialError {
  double wrong = 0;    // share of the rays answered wrongly
  double depth = 0;    // mean error of the distance where both hit, in diagonals
  double picture = 0;  // of ambient occlusion, over its mean or 0.25: the worse of a short and a long radius
  double light = 0;    // of the light that comes back to a point, over its mean
};

struct Rays {
  std::vector<LspRay> rays;  // kPerPoint of each point, one after the other
  std::vector<View> views;   // of them
  std::vector<LspHit> truth;
  std::vector<LspRay> counted_rays;
  lsp_trace_counts counts{};  // of exact rays
  // By dial: what is known already.
  std::map<uint32_t, DialError> measured;
  std::map<uint32_t, lsp_trace_counts> counted;
};

// `counts` may be null.
std::vector<LspHit> trace(const lsp_scene& scene, const lsp_trace_options& options,
                          const std::vector<LspRay>& rays, lsp_trace_counts* counts) {
  std::vector<LspHit> hits(rays.size());
  constexpr size_t kPart = 1024;
  const size_t parts = (rays.size() + kPart - 1) / kPart;
  std::vector<lsp_trace_counts> sums(parts);
  tbb::parallel_for(size_t(0), parts, [&](size_t p) {
    const size_t first = p * kPart;
    lsp_trace(&scene, &options, &rays[first], &hits[first], std::min(kPart, rays.size() - first),
              counts ? &sums[p] : nullptr, nullptr);
  });
  if (counts)
    for (const lsp_trace_counts& sum : sums) lsp_add_counts(counts, &sum);
  return hits;
}

// How open each point is to a radius: the share of its rays that meet nothing nearer.
double open_share(const LspHit* hits, double radius) {
  int open = 0;
  for (uint32_t k = 0; k < kPerPoint; ++k) open += hits[k].t < radius ? 0 : 1;
  return double(open) / kPerPoint;
}

uint32_t dial_of(const LspHeader& h, uint32_t quality) {
  return LSP_DIAL(h.quality[quality], h.quality_part[quality]);
}

void set_dial(LspHeader& h, uint32_t quality, uint32_t dial) {
  h.quality[quality] = dial / LSP_DIAL_PARTS & LSP_HEEDS(0xFu, 0xFu);
  h.quality_part[quality] = dial & LSP_HEEDS(0xFu, 0xFu);
}

// Sums over points of what is true and of how far off the answer is.
struct Measured {
  double truth = 0, off = 0;
  void add(double t, double a) {
    truth += t;
    off += std::fabs(a - t);
  }
};

// Tries dials, in the header's `balanced`.
class Dial {
 public:
  explicit Dial(Baked& baked)
      : header_(baked.header),
        scene_(view(baked)),
        diagonal_(diagonal(baked.header)),
        exact_bytes_(exact_bytes(baked)) {
    for (const LspMaterial& m : baked.materials) {
      const glm::vec3 color = vec(m.base_color) + vec(m.emission);
      brightness_.push_back((color.x + color.y + color.z) / 3);
    }
    material_.resize(header_.primitive_count);
    for (const LspTriangle& t : baked.triangles) material_[t.primitive] = t.material;
    sets_[0].rays = surface_rays(baked, kPoints, kPerPoint);
    sets_[1].rays = seen_rays(baked, kPoints, kPerPoint);
    ViewRays pictures = view_rays(baked, kViews, kSide, kPerPoint);
    sets_[2].rays = std::move(pictures.rays);
    sets_[2].views = std::move(pictures.views);
    for (Rays& set : sets_) {
      const auto points = uint32_t(set.rays.size() / kPerPoint);
      if (set.views.empty()) set.views = {{0, points, points}};
    }
    for (Rays& set : sets_) {
      for (size_t i = 0; i < set.rays.size(); ++i)
        if (i / kPerPoint % kCounted == 0) set.counted_rays.push_back(set.rays[i]);
      set.truth = trace(scene_, {0, 0, 0, 0}, set.rays, nullptr);
      trace(scene_, {0, 0, 0, 0}, set.counted_rays, &set.counts);
    }
  }

  // Of a quality as the header states it: the worst error of any set, and the gain over all rays.
  QualityFigures figures(uint32_t quality) {
    QualityFigures out;
    lsp_trace_counts exact{}, cells{};
    for (Rays& set : sets_) {
      const DialError& error = measured(set, quality);
      out.wrong = std::max(out.wrong, error.wrong);
      out.depth = std::max(out.depth, error.depth);
      out.occlusion = std::max(out.occlusion, error.picture);
      out.light = std::max(out.light, error.light);
      lsp_add_counts(&exact, &set.counts);
      lsp_add_counts(&cells, &counted(set, quality));
    }
    if (exact.rays == 0) return {};
    const Costs cpu = cpu_costs(exact_bytes_);
    out.vulkan = kVulkan.exact(exact) / kVulkan.cells(cells);
    out.cpu = cpu.exact(exact) / cpu.cells(cells);
    return out;
  }

  // The dial that traces least exactly of those that keep within errors, no more than `most`, or 0. Answers
  // where rays begin and in other cells lose classes of one kind, and so many are heeded of both: the best
  // pair for these rays was a worse one for others.
  uint32_t farthest(double wrong, uint32_t most) {
    // What nobody knows is never heeded: rays of other places than these may come there.
    constexpr uint32_t kStep = LSP_DIAL_PARTS / 4, kLast = LSP_DIAL_PARTS * (LSP_LOSS_UNKNOWN + 1) - kStep;
    const auto dial = [](uint32_t steps) { return LSP_HEEDS(steps * kStep, steps * kStep); };
    const auto keeps_at = [&](uint32_t steps) {
      set_dial(header_, LSP_QUALITY_BALANCED, dial(steps));
      return keeps(wrong);
    };
    uint32_t kept = 0, lost = std::min(most & 0xFFu, kLast) / kStep + 1;
    while (lost - kept > 1) {
      const uint32_t middle = (kept + lost) / 2;
      (keeps_at(middle) ? kept : lost) = middle;
    }
    return dial(kept);
  }

 private:
  // Whether the header's `balanced` keeps within errors with all rays: those that did not the last time most
  // likely do not now, and then spare the others.
  bool keeps(double wrong) {
    if (!within(measured(sets_[worst_], LSP_QUALITY_BALANCED), wrong)) return false;
    for (size_t i = 0; i < sets_.size(); ++i)
      if (!within(measured(sets_[i], LSP_QUALITY_BALANCED), wrong)) {
        worst_ = i;
        return false;
      }
    return true;
  }
  static double diagonal(const LspHeader& h) {
    return glm::length(glm::dvec3(h.bounds_max.x, h.bounds_max.y, h.bounds_max.z) -
                       glm::dvec3(h.bounds_min.x, h.bounds_min.y, h.bounds_min.z));
  }
  static bool within(const DialError& e, double wrong) {
    return e.wrong <= wrong && e.depth <= wrong && e.picture <= 3 * wrong && e.light <= 4 * wrong;
  }

  // The light that comes to a point by its rays: from the sky, and from what they meet, lit from one side,
  // another one for each point. There are no shadows in it: it is the surface that counts.
  double light_at(const LspRay* rays, const LspHit* hits, size_t point) const {
    constexpr float kSide = 0.57735f;
    const glm::vec3 towards(point & 1 ? kSide : -kSide, point & 2 ? kSide : -kSide,
                            point & 4 ? kSide : -kSide);
    double sum = 0;
    for (uint32_t k = 0; k < kPerPoint; ++k) {
      const LspHit& hit = hits[k];
      if (hit.primitive == LSP_NONE) {
        sum += 1;
        continue;
      }
      const float front = glm::dot(vec(hit.normal), vec(rays[k].direction)) > 0 ? -1.0f : 1.0f;
      const float lit = 0.5f + 0.5f * front * glm::dot(vec(hit.normal), towards);
      sum += double(brightness_[material_[hit.primitive]] * lit);
    }
    return sum / kPerPoint;
  }

  // The error of the view that errs most.
  double worst_picture(const Rays& set, const std::vector<LspHit>& hits, double radius) const {
    double worst = 0;
    for (const View& view : set.views) worst = std::max(worst, picture(set, hits, view, radius));
    return worst;
  }

  // The error of a picture of ambient occlusion; where nothing is seen it is white.
  double picture(const Rays& set, const std::vector<LspHit>& hits, const View& view, double radius) const {
    if (view.pixels == 0) return 0;
    Measured open;
    open.truth = view.pixels - view.count;
    for (size_t p = view.first; p < size_t{view.first} + view.count; ++p)
      open.add(open_share(&set.truth[p * kPerPoint], radius * diagonal_),
               open_share(&hits[p * kPerPoint], radius * diagonal_));
    return open.off / std::max(0.25 * view.pixels, open.truth);
  }

  // The searches for two qualities, and their figures, ask for the same dials.
  const DialError& measured(Rays& set, uint32_t quality) const {
    const auto [known, added] = set.measured.try_emplace(dial_of(header_, quality));
    if (added) known->second = measure(set, quality);
    return known->second;
  }

  const lsp_trace_counts& counted(Rays& set, uint32_t quality) const {
    const auto [known, added] = set.counted.try_emplace(dial_of(header_, quality));
    if (added) trace(scene_, options_of(quality), set.counted_rays, &known->second);
    return known->second;
  }

  static lsp_trace_options options_of(uint32_t quality) {
    lsp_trace_options options{};
    options.flags = LSP_TRACE_APPROXIMATE;
    options.quality = quality;
    return options;
  }

  DialError measure(const Rays& set, uint32_t quality) const {
    DialError error;
    const std::vector<LspHit> hits = trace(scene_, options_of(quality), set.rays, nullptr);
    size_t wrong = 0, both = 0;
    double depth = 0;
    for (size_t i = 0; i < hits.size(); ++i) {
      const bool answer = hits[i].primitive != LSP_NONE, truth = set.truth[i].primitive != LSP_NONE;
      wrong += answer != truth;
      if (!answer || !truth) continue;
      ++both;
      depth += std::fabs(double(hits[i].t) - double(set.truth[i].t));
    }
    const double rays = double(std::max<size_t>(1, hits.size()));
    error.wrong = double(wrong) / rays;
    error.depth = both ? depth / double(both) / diagonal_ : 0;
    for (double radius : kRadii) error.picture = std::max(error.picture, worst_picture(set, hits, radius));
    if (!brightness_.empty()) {
      Measured light;
      for (size_t p = 0; p < hits.size(); p += kPerPoint)
        light.add(light_at(&set.rays[p], &set.truth[p], p / kPerPoint),
                  light_at(&set.rays[p], &hits[p], p / kPerPoint));
      error.light = light.truth > 0 ? light.off / light.truth : 0;
    }
    return error;
  }

  LspHeader& header_;
  const lsp_scene scene_;
  const double diagonal_;
  const uint64_t exact_bytes_;
  std::vector<float> brightness_;   // by material; empty: light does not count
  std::vector<uint32_t> material_;  // by primitive
  std::array<Rays, 3> sets_;
  size_t worst_ = 0;  // the set that last did not keep within errors
};

}  // namespace

void choose_dial(Baked& baked, double wrong) {
  LspHeader& h = baked.header;
  baked.qualities = {};
  for (uint32_t quality = 0; quality < LSP_QUALITY_COUNT; ++quality) set_dial(h, quality, LSP_DIAL_TABLES);
  if (baked.cell_tables.references.empty()) return;
  Dial dial(baked);
  const uint32_t balanced = dial.farthest(wrong, LSP_DIAL_TABLES);
  // Whatever this heeds balanced does, too, or it might err more in pictures that nobody measured.
  const uint32_t accurate = dial.farthest(0.5 * wrong, balanced);
  set_dial(h, LSP_QUALITY_BALANCED, balanced);
  set_dial(h, LSP_QUALITY_ACCURATE, accurate);
  for (uint32_t quality = 0; quality < LSP_QUALITY_COUNT; ++quality)
    baked.qualities[quality] = dial.figures(quality);
}

}  // namespace lsp
