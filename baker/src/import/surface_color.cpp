#include "import/surface_color.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace lsp {
namespace {

constexpr double kMostTexels = 4096, kFewestTexels = 64, kTexelsOfAll = 1 << 20;
// What is solid of a triangle below this share is nothing.
constexpr double kNothing = 1e-6;

// A convex polygon in the plane with few corners.
struct Cut {
  glm::dvec2 corners[8];
  int count = 0;
};

// The part where the coordinate on `axis` is at least `bound` (or at most, with `below`).
Cut clip(const Cut& from, int axis, double bound, bool below) {
  Cut out;
  const auto inside = [&](const glm::dvec2& p) { return below ? p[axis] <= bound : p[axis] >= bound; };
  for (int i = 0; i < from.count; ++i) {
    const glm::dvec2 &a = from.corners[i], &b = from.corners[(i + 1) % from.count];
    const bool a_in = inside(a), b_in = inside(b);
    if (a_in && out.count < 8) out.corners[out.count++] = a;
    if (a_in != b_in && out.count < 8) {
      glm::dvec2 p = a + (b - a) * ((bound - a[axis]) / (b[axis] - a[axis]));
      p[axis] = bound;
      out.corners[out.count++] = p;
    }
  }
  return out;
}

double cross(const glm::dvec2& a, const glm::dvec2& b) { return a.x * b.y - a.y * b.x; }

// Area and centroid.
double measure(const Cut& cut, glm::dvec2& centroid) {
  double sum = 0;
  centroid = glm::dvec2(0);
  for (int i = 2; i < cut.count; ++i) {
    const glm::dvec2 &a = cut.corners[0], &b = cut.corners[i - 1], &c = cut.corners[i];
    const double area = std::abs(cross(b - a, c - a)) / 2;
    sum += area;
    centroid += area * (a + b + c) / 3.0;
  }
  if (sum > 0) centroid /= sum;
  return sum;
}

// Barycentric weights of corners 1 and 2.
using Weights = glm::dvec2;

// Calls visit(weights) for the middles of the n * n equal parts of a triangle.
template <typename Visit>
void for_each_part(int n, const Visit& visit) {
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < n - i; ++k) {
      visit(Weights(i + 1.0 / 3, k + 1.0 / 3) / double(n));
      if (k + 1 < n - i) visit(Weights(i + 2.0 / 3, k + 2.0 / 3) / double(n));
    }
  }
}

// A texture over one triangle, its corners in texels of the finest level.
class Footprint {
 public:
  Footprint(const TextureUse& use, const glm::dvec2 (&uv)[3], double most_texels) : use_(use) {
    const Texture::Size size = use.texture->size(0);
    for (int i = 0; i < 3; ++i) at_[i] = uv[i] * glm::dvec2(size.width, size.height);
    const glm::dvec2 low = glm::min(at_[0], glm::min(at_[1], at_[2]));
    const glm::dvec2 extent = glm::max(at_[0], glm::max(at_[1], at_[2])) - low;
    longest_ = std::max(extent.x, extent.y);
    area_ = std::abs(cross(at_[1] - at_[0], at_[2] - at_[0])) / 2;
    usable_ =
        std::isfinite(area_) && std::isfinite(longest_) && std::abs(low.x) < 1e12 && std::abs(low.y) < 1e12;
    small_ = !(area_ >= 1) && (!use.nearest || area_ < 1e-9);
    while (!small_ && level_ + 1 < use.texture->levels() && !fits(most_texels)) ++level_;
    if (!small_ && !fits(most_texels)) usable_ = false;
  }

  // The level whose texels visit() looks at.
  size_t level() const { return usable_ ? small_ ? 0 : level_ : use_.texture->levels() - 1; }

  // Calls visit(share of the area, weights, texel) for the pieces of the triangle. `alpha`, where there is
  // one, gives the vertices' at a place: then the finest level alone is right.
  template <typename Alpha, typename Visit>
  void visit(const Alpha& alpha, const Visit& visit) const {
    const Texture& texture = *use_.texture;
    if (!usable_) return visit(1.0, Weights(1.0 / 3), texture.texel(level(), 0, 0, use_.wrap_x, use_.wrap_y));
    if (small_) {
      const int n = std::clamp(int(std::ceil(std::min(longest_, 1e6) * 2)), 3, 24);
      for_each_part(n, [&](const Weights& w) { visit(1.0 / (n * n), w, sample(w)); });
      return;
    }
    const Texture::Size fine = texture.size(0), size = texture.size(level_);
    const glm::dvec2 scale(double(size.width) / fine.width, double(size.height) / fine.height);
    Cut whole{{at_[0] * scale, at_[1] * scale, at_[2] * scale}, 3};
    const glm::dvec2 a = whole.corners[0], ab = whole.corners[1] - a, ac = whole.corners[2] - a;
    const double doubled = cross(ab, ac);
    const auto weights_of = [&](const glm::dvec2& p) {
      return Weights(cross(p - a, ac), cross(ab, p - a)) / doubled;
    };
    const auto range = [](const Cut& cut, int axis) {
      double low = INFINITY, high = -INFINITY;
      for (int i = 0; i < cut.count; ++i) {
        low = std::min(low, cut.corners[i][axis]);
        high = std::max(high, cut.corners[i][axis]);
      }
      return std::pair(low, high);
    };
    for (double y = std::floor(range(whole, 1).first); whole.count > 2; ++y) {
      Cut row = clip(whole, 1, y + 1, true);
      whole = clip(whole, 1, y + 1, false);
      for (double x = std::floor(range(row, 0).first); row.count > 2; ++x) {
        const Cut piece = clip(row, 0, x + 1, true);
        row = clip(row, 0, x + 1, false);
        glm::dvec2 centroid;
        const double area = measure(piece, centroid);
        if (!(area > 0)) continue;
        const Weights w = weights_of(centroid);
        const auto i = int64_t(x), j = int64_t(y);
        visit(area / (std::abs(doubled) / 2), w,
              alpha && level_ == 0 ? texture.texel_times(alpha(w), i, j, use_.wrap_x, use_.wrap_y)
                                   : texture.texel(level_, i, j, use_.wrap_x, use_.wrap_y));
      }
    }
  }

  // The finest level at a place.
  glm::vec4 sample(const Weights& w) const {
    const glm::dvec2 at = at_[0] + w.x * (at_[1] - at_[0]) + w.y * (at_[2] - at_[0]);
    if (!usable_ || !std::isfinite(at.x) || !std::isfinite(at.y)) return glm::vec4(0, 0, 0, 1);
    if (use_.nearest)
      return use_.texture->texel(0, int64_t(std::floor(at.x)), int64_t(std::floor(at.y)), use_.wrap_x,
                                 use_.wrap_y);
    return use_.texture->bilinear(at, use_.wrap_x, use_.wrap_y);
  }

 private:
  bool fits(double most_texels) const {
    const Texture::Size fine = use_.texture->size(0), size = use_.texture->size(level_);
    const double x = double(size.width) / fine.width, y = double(size.height) / fine.height;
    return area_ * x * y <= most_texels && longest_ * std::max(x, y) <= 8 * most_texels;
  }

  const TextureUse& use_;
  glm::dvec2 at_[3];
  double longest_ = 0, area_ = 0;
  bool usable_ = true, small_ = false;
  size_t level_ = 0;
};

// Sums over the pieces of one triangle.
class Mean {
 public:
  Mean(const Surface& surface, const SurfaceCorner (&corners)[3], double most_texels)
      : surface_(surface), corners_(corners), most_texels_(most_texels) {
    for (const SurfaceCorner& corner : corners) {
      plain_ = plain_ && corner.color == glm::vec4(1);
      solid_ = solid_ && corner.color.a == 1;
    }
  }

  TriangleColor color() {
    const glm::dvec2 glow_uv[3] = {corners_[0].glow_uv, corners_[1].glow_uv, corners_[2].glow_uv};
    const bool glows = surface_.glow.texture != nullptr && surface_.emission != glm::vec3(0);
    std::unique_ptr<Footprint> glow;
    if (glows) glow = std::make_unique<Footprint>(surface_.glow, glow_uv, most_texels_);
    // Where parts are missing, only what the others emit counts.
    const bool together = glows && surface_.base.texture && surface_.alpha.mode != AlphaMode::kOpaque;
    add_base(together ? glow.get() : nullptr);
    if (glows && !together) {
      const std::function<float(Weights)> no_alpha;
      glow->visit(no_alpha, [&](double share, const Weights&, const glm::vec4& texel) {
        glow_ += share * glm::dvec3(texel);
      });
    }
    TriangleColor out;
    out.coverage = float(std::min(1.0, coverage_));
    if (coverage_ < kNothing) return {surface_.base_color, glm::vec3(0), 0.0f};
    out.base_color = glm::clamp(surface_.base_color * glm::vec3(base_ / coverage_), 0.0f, 1.0f);
    out.emission = surface_.emission;
    if (glows) out.emission *= glm::vec3(together ? glow_ / coverage_ : glow_);
    return out;
  }

 private:
  glm::vec4 vertex_color(const Weights& w) const {
    return corners_[0].color * float(1 - w.x - w.y) + corners_[1].color * float(w.x) +
           corners_[2].color * float(w.y);
  }

  void add_base(const Footprint* glow) {
    const bool by_vertex = !solid_ && surface_.alpha.mode != AlphaMode::kOpaque;
    std::function<float(Weights)> alpha;
    if (by_vertex && surface_.alpha.mode == AlphaMode::kMask)
      alpha = [&](const Weights& w) { return vertex_color(w).a; };
    const auto add = [&](double share, const Weights& w, glm::vec4 texel) {
      const glm::vec4 color = plain_ ? glm::vec4(1) : vertex_color(w);
      if (by_vertex && !alpha) texel *= color.a;
      base_ += share * glm::dvec3(texel * color);
      coverage_ += share * double(texel.a);
      if (glow) glow_ += share * double(texel.a) * glm::dvec3(glow->sample(w));
    };
    if (surface_.base.texture) {
      const glm::dvec2 uv[3] = {corners_[0].base_uv, corners_[1].base_uv, corners_[2].base_uv};
      Footprint(surface_.base, uv, most_texels_).visit(alpha, add);
    } else if (by_vertex) {
      constexpr int kParts = 16;
      for_each_part(kParts, [&](const Weights& w) {
        add(1.0 / (kParts * kParts), w, glm::vec4(surface_.alpha.coverage(alpha ? alpha(w) : 1.0f)));
      });
    } else {
      add(1, Weights(1.0 / 3), glm::vec4(surface_.alpha.coverage(1)));
    }
  }

  const Surface& surface_;
  const SurfaceCorner (&corners_)[3];
  const double most_texels_;
  bool plain_ = true, solid_ = true;
  glm::dvec3 base_{0}, glow_{0};
  double coverage_ = 0;
};

}  // namespace

std::vector<TriangleColor> mean_colors(const Surface& surface, size_t count,
                                       const std::function<void(size_t, SurfaceCorner (&)[3])>& corners_of) {
  const double most_texels =
      std::clamp(kTexelsOfAll / std::max(1.0, double(count)), kFewestTexels, kMostTexels);
  // The levels that some triangle will look at are made before the threads start.
  const auto make_levels = [&](const TextureUse& use, glm::dvec2 SurfaceCorner::*uv) {
    if (!use.texture) return;
    size_t level = 0;
    SurfaceCorner corners[3];
    for (size_t t = 0; t < count; ++t) {
      corners_of(t, corners);
      const glm::dvec2 at[3] = {corners[0].*uv, corners[1].*uv, corners[2].*uv};
      level = std::max(level, Footprint(use, at, most_texels).level());
    }
    use.texture->make_levels(level);
  };
  make_levels(surface.base, &SurfaceCorner::base_uv);
  make_levels(surface.glow, &SurfaceCorner::glow_uv);
  std::vector<TriangleColor> colors(count);
  tbb::parallel_for(size_t{0}, count, [&](size_t t) {
    SurfaceCorner corners[3];
    corners_of(t, corners);
    colors[t] = Mean(surface, corners, most_texels).color();
  });
  return colors;
}

}  // namespace lsp
