#include "import/surface_color.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <optional>

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

// The part where `height`, which must be linear, is at least 0.
template <typename Height>
Cut clip(const Cut& from, const Height& height) {
  Cut out;
  double heights[8];
  for (int i = 0; i < from.count; ++i) heights[i] = height(from.corners[i]);
  for (int i = 0; i < from.count; ++i) {
    const int next = (i + 1) % from.count;
    const double a = heights[i], b = heights[next];
    if (a >= 0 && out.count < 8) out.corners[out.count++] = from.corners[i];
    if ((a >= 0) != (b >= 0) && out.count < 8)
      out.corners[out.count++] = from.corners[i] + (from.corners[next] - from.corners[i]) * (a / (a - b));
  }
  return out;
}

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
    constexpr double kMost = 1e12;  // so that places fit into whole numbers
    usable_ = std::isfinite(area_) && longest_ < kMost && std::abs(low.x) < kMost && std::abs(low.y) < kMost;
    small_ = !(area_ >= 1) && (!use.nearest || area_ < 1e-9);
    while (!small_ && level_ + 1 < use.texture->levels() && !fits(most_texels)) ++level_;
    if (!small_ && !fits(most_texels)) usable_ = false;
  }

  // The level whose texels visit() looks at.
  size_t level() const { return usable_ ? small_ ? 0 : level_ : use_.texture->levels() - 1; }

  // In how many pieces visit() takes the triangle, about.
  double pieces() const { return !usable_ || small_ ? 1 : area_ / (steps().x * steps().y); }

  // Calls visit(share of the area, weights, texel) for the pieces of the triangle. `alpha`, where there is
  // one, gives the vertices' at a place, linear, for a mask: then the finest level alone is right.
  template <typename Alpha, typename Visit>
  void visit(const Alpha& alpha, const Visit& visit) const {
    const Texture& texture = *use_.texture;
    if (!usable_) return visit(1.0, Weights(1.0 / 3), texture.texel(level(), 0, 0, use_.wrap_x, use_.wrap_y));
    if (alpha && (small_ || level_ > 0)) {
      const int n = small_ ? 24 : 64;
      for_each_part(n, [&](const Weights& w) { visit(1.0 / (n * n), w, texel_times(alpha(w), w)); });
      return;
    }
    if (small_) {
      const int n = std::clamp(int(std::ceil(std::min(longest_, 1e6) * 2)), 3, 24);
      for_each_part(n, [&](const Weights& w) { visit(1.0 / (n * n), w, sample(w)); });
      return;
    }
    Cut whole{{at_[0] / steps(), at_[1] / steps(), at_[2] / steps()}, 3};
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
        Cut piece = clip(row, 0, x + 1, true);
        row = clip(row, 0, x + 1, false);
        const auto i = int64_t(x), j = int64_t(y);
        if (alpha) {
          const float least = texture.least_alpha(i, j, use_.wrap_x, use_.wrap_y);
          piece = clip(piece, [&](const glm::dvec2& p) { return double(alpha(weights_of(p)) - least); });
        }
        glm::dvec2 centroid;
        const double area = measure(piece, centroid);
        if (!(area > 0)) continue;
        visit(area / (std::abs(doubled) / 2), weights_of(centroid),
              alpha ? texture.texel_times(kSolid, i, j, use_.wrap_x, use_.wrap_y)
                    : texture.texel(level_, i, j, use_.wrap_x, use_.wrap_y));
      }
    }
  }

  // What visit() sees at a place.
  template <typename Alpha>
  glm::vec4 look_at(const Weights& w, const Alpha& alpha) const {
    if (!usable_) return use_.texture->texel(level(), 0, 0, use_.wrap_x, use_.wrap_y);
    if (alpha) return texel_times(alpha(w), w);
    if (small_) return sample(w);
    const glm::dvec2 at = place(w) / steps();
    return use_.texture->texel(level_, int64_t(std::floor(at.x)), int64_t(std::floor(at.y)), use_.wrap_x,
                               use_.wrap_y);
  }

 private:
  static constexpr float kSolid = 1e30f;  // a vertex's alpha that passes every test that one can pass

  // Texels of the finest level that one of the level has on either axis.
  glm::dvec2 steps() const {
    const Texture::Size fine = use_.texture->size(0), size = use_.texture->size(level_);
    return {double(fine.width) / size.width, double(fine.height) / size.height};
  }
  bool fits(double most_texels) const {
    const glm::dvec2 step = steps();
    return area_ / (step.x * step.y) <= most_texels && longest_ / std::min(step.x, step.y) <= 8 * most_texels;
  }
  glm::dvec2 place(const Weights& w) const {
    return at_[0] + w.x * (at_[1] - at_[0]) + w.y * (at_[2] - at_[0]);
  }
  glm::vec4 sample(const Weights& w) const {
    const glm::dvec2 at = place(w);
    if (use_.nearest)
      return use_.texture->texel(0, int64_t(std::floor(at.x)), int64_t(std::floor(at.y)), use_.wrap_x,
                                 use_.wrap_y);
    return use_.texture->bilinear(at, use_.wrap_x, use_.wrap_y);
  }
  glm::vec4 texel_times(float alpha, const Weights& w) const {
    const glm::dvec2 at = place(w);
    return use_.texture->texel_times(alpha, int64_t(std::floor(at.x)), int64_t(std::floor(at.y)), use_.wrap_x,
                                     use_.wrap_y);
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
    const auto lay = [&](const TextureUse& use, glm::dvec2 SurfaceCorner::*uv, std::optional<Footprint>& to) {
      const glm::dvec2 at[3] = {corners_[0].*uv, corners_[1].*uv, corners_[2].*uv};
      if (use.texture) to.emplace(use, at, most_texels_);
    };
    lay(surface_.base, &SurfaceCorner::base_uv, base_);
    if (surface_.emission != glm::vec3(0)) lay(surface_.glow, &SurfaceCorner::glow_uv, glow_);
    add_base();
    TriangleColor out;
    out.coverage = float(std::min(1.0, coverage_));
    if (coverage_ < kNothing) return {surface_.base_color, glm::vec3(0), 0.0f};
    out.base_color = glm::clamp(surface_.base_color * glm::vec3(color_ / coverage_), 0.0f, 1.0f);
    out.emission = surface_.emission;
    if (glow_) out.emission *= glm::vec3(mean_glow());
    return out;
  }

 private:
  glm::vec4 vertex_color(const Weights& w) const {
    return corners_[0].color * float(1 - w.x - w.y) + corners_[1].color * float(w.x) +
           corners_[2].color * float(w.y);
  }
  // Whether vertices say how much is there, by a threshold or as a factor.
  bool is_masked() const { return !solid_ && surface_.alpha.mode == AlphaMode::kMask; }
  bool is_blended() const { return !solid_ && surface_.alpha.mode == AlphaMode::kBlend; }
  std::function<float(Weights)> mask() const {
    if (!is_masked()) return nullptr;
    return [this](const Weights& w) { return vertex_color(w).a; };
  }

  void add_base() {
    const auto add = [&](double share, const Weights& w, glm::vec4 texel) {
      const glm::vec4 color = plain_ ? glm::vec4(1) : vertex_color(w);
      if (is_blended()) texel *= color.a;
      color_ += share * glm::dvec3(texel * color);
      coverage_ += share * double(texel.a);
    };
    if (base_) {
      base_->visit(mask(), add);
    } else if (is_masked()) {
      const double least = double(surface_.alpha.least(1));
      const Cut whole{{glm::dvec2(0, 0), glm::dvec2(1, 0), glm::dvec2(0, 1)}, 3};
      glm::dvec2 centroid;
      const double area =
          measure(clip(whole, [&](const Weights& w) { return double(vertex_color(w).a) - least; }), centroid);
      if (area > 0) add(2 * area, centroid, glm::vec4(1 - surface_.alpha.glass));
    } else if (is_blended()) {
      constexpr int kParts = 16;
      for_each_part(kParts, [&](const Weights& w) {
        add(1.0 / (kParts * kParts), w, glm::vec4(surface_.alpha.coverage(1)));
      });
    } else {
      add(1, Weights(1.0 / 3), glm::vec4(surface_.alpha.coverage(1)));
    }
  }

  // How much is there at a place.
  double coverage_at(const Weights& w) const {
    const float alpha = vertex_color(w).a;
    const float there =
        base_ ? base_->look_at(w, mask()).a : surface_.alpha.coverage(is_masked() ? alpha : 1);
    return double(is_blended() ? there * alpha : there);
  }

  // The mean of the emission texture where something is there, walking over the finer of both textures.
  glm::dvec3 mean_glow() const {
    const std::function<float(Weights)> no_alpha;
    const bool whole = surface_.alpha.mode == AlphaMode::kOpaque || (!base_ && solid_);
    glm::dvec3 glow(0);
    double sum = 0;
    const auto add = [&](double there, const glm::vec4& texel) {
      glow += there * glm::dvec3(texel);
      sum += there;
    };
    if (base_ && !whole && base_->pieces() > glow_->pieces()) {
      base_->visit(mask(), [&](double share, const Weights& w, const glm::vec4& texel) {
        const double there = double(is_blended() ? texel.a * vertex_color(w).a : texel.a);
        add(share * there, glow_->look_at(w, no_alpha));
      });
    } else {
      glow_->visit(no_alpha, [&](double share, const Weights& w, const glm::vec4& texel) {
        add(share * (whole ? 1 : coverage_at(w)), texel);
      });
    }
    return sum > 0 ? glow / sum : glow;
  }

  const Surface& surface_;
  const SurfaceCorner (&corners_)[3];
  const double most_texels_;
  std::optional<Footprint> base_, glow_;
  bool plain_ = true, solid_ = true;
  glm::dvec3 color_{0};
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
