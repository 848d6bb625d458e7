#include "cell_filler.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>

#include "../pcg.h"
#include "../vectors.h"
#include "box.h"
#include "lsp/lsp.h"
#include "lsp/program.h"

namespace lsp {
namespace {

constexpr uint32_t kFirst = 8;         // rays of a shaft that may settle it
constexpr uint32_t kBeforeEmpty = 24;  // rays before a shaft counts as empty
constexpr float kSubMargin = 0.02f;    // of a sub-cell's edge: what comes this close counts as in it
constexpr float kSameDirection = 0.9999f;
constexpr float kSameDistance = 1e-3f;  // of a cell's edge

// A hash, to [0, 1).
float hash(uint32_t a, uint32_t b, uint32_t c) {
  return float(pcg(a * 747796405u + b * 277803737u + c * 2891336453u + 1u) >> 8) * 0x1p-24f;
}

// An additive low-discrepancy sequence (Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences",
// 2018), moved by a hash of `seed`.
template <size_t kDimensions>
class Sequence {
 public:
  explicit Sequence(uint32_t seed) {
    for (size_t k = 0; k < kDimensions; ++k) start_[k] = hash(seed, uint32_t(k), 77);
  }
  std::array<float, kDimensions> operator()(uint32_t i) const {
    static_assert(kDimensions == 4 || kDimensions == 5);
    constexpr double root =
        kDimensions == 4 ? 1.1673039782614187 : 1.1347241384015194;  // of x^(d + 1) = x + 1
    std::array<float, kDimensions> out;
    double a = 1;
    for (size_t k = 0; k < kDimensions; ++k) {
      a /= root;
      const double x = double(start_[k]) + i * a;
      out[k] = std::min(float(x - std::floor(x)), 0.99999994f);
    }
    return out;
  }

 private:
  std::array<float, kDimensions> start_;
};

// The point of the unit circle at `turns` in [0, 1), by polynomials: a library's sine may differ between
// machines.
glm::vec2 circle(float turns) {
  const float quarter = std::floor(4 * turns), x = (4 * turns - quarter - 0.5f) * 1.57079633f, x2 = x * x;
  const float s = x * (1 - x2 * (1 / 6.0f - x2 * (1 / 120.0f - x2 / 5040)));
  const float c = 1 - x2 * (0.5f - x2 * (1 / 24.0f - x2 * (1 / 720.0f)));
  switch (int(quarter)) {
    case 0:
      return {c, s};
    case 1:
      return {-s, c};
    case 2:
      return {-c, -s};
    default:
      return {s, -c};
  }
}

struct Face {
  int axis, u, v, side;
  explicit Face(uint32_t face)
      : axis(int(face / 2)), u(axis == 0 ? 1 : 0), v(axis == 2 ? 1 : 2), side(int(face % 2)) {}
};

class Filler {
 public:
  Filler(const CellScene& scene, uint32_t cell)
      : scene_(scene),
        cell_(scene.grid.cells[cell]),
        number_(cell),
        size_(scene.grid.size),
        lo_(scene.grid.corner(cell_.at)),
        centre_(lo_ + 0.5f * size_),
        fit_({scene.options.splits}, size_) {
    records_ = std::span(scene.grid.records).subspan(cell_.first, cell_.count);
    plane_of_.assign(cell_.count, kNoPlane);
    build_tree();
  }

  FilledCell run() {
    fill_far();
    fill_origin();
    finish();
    return std::move(out_);
  }

 private:
  // A tree of the cell's own triangles, numbered from 0.
  void build_tree() {
    Mesh mesh;
    for (uint32_t i = 0; i < cell_.count; ++i) {
      const LspTriangle& t = scene_.triangles[records_[i]];
      for (const lsp_float3& v : {t.v0, t.v1, t.v2}) mesh.positions.push_back(vec(v));
      mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    BvhOptions options;
    options.spatial_splits = false;
    options.heuristic_depth = LSP_MAX_CELL_DEPTH - uint32_t(std::bit_width(LSP_CELL_MAX_REFERENCES));
    tree_ = build_bvh(mesh, options);
    out_.tree = compact(tree_, lo_ - scene_.grid.margin, size_ + 2 * scene_.grid.margin);
    for (uint32_t& r : out_.tree.references) r = records_[r];
    Box bounds;
    for (uint32_t r : tree_.records) {
      local_.push_back(scene_.triangles[records_[r]]);
      local_.back().primitive = r;
      for (const lsp_float3& v : {local_.back().v0, local_.back().v1, local_.back().v2}) bounds.grow(vec(v));
    }
    header_.base_structure = LSP_BASE_BVH;
    header_.required_features = LSP_FEATURE_EXACT;
    header_.root = tree_.root;
    header_.root_line_space = LSP_NONE;
    header_.bounds_min = f3(bounds.lo);
    header_.bounds_max = f3(bounds.hi);
    header_.node_count = uint32_t(tree_.nodes.size());
    header_.triangle_count = uint32_t(local_.size());
    header_.max_depth = tree_.max_depth;
    header_.max_stack = std::max(1u, tree_.max_depth);
    header_.max_steps = uint32_t(tree_.nodes.size()) + tree_.leaf_count + 1;
    header_.max_leaf_triangles = tree_.max_leaf_triangles;
    own_ = {};
    own_.header = &header_;
    own_.nodes = tree_.nodes.data();
    own_.triangles = local_.data();
  }

  static void trace(const lsp_scene& scene, uint32_t flags, std::vector<LspRay>& rays,
                    std::vector<LspHit>& hits) {
    hits.resize(rays.size());
    const lsp_trace_options options = {flags, 0, 0, 0};
    if (!rays.empty() &&
        lsp_trace(&scene, &options, rays.data(), hits.data(), rays.size(), nullptr, nullptr) != LSP_OK)
      throw Failure(Exit::kInternal, "", "the tracer refused the baker's own tree");
  }

  // The plane of a triangle of the cell; those of coplanar ones are one.
  uint32_t plane_of(uint32_t triangle) {
    if (plane_of_[triangle] != kNoPlane) return plane_of_[triangle];
    const LspTriangle& t = scene_.triangles[records_[triangle]];
    const glm::dvec3 a(vec(t.v0)), b(vec(t.v1)), c(vec(t.v2));
    const glm::dvec3 area = glm::cross(b - a, c - a);
    const double length = glm::length(area);
    const glm::dvec3 normal = length > 0 ? area / length : glm::dvec3(0, 0, 1);
    const Plane plane = {glm::vec3(normal), float(glm::dot(normal, a - glm::dvec3(centre_)))};
    for (uint32_t k = 0; k < out_.planes.size(); ++k) {
      const float same = glm::dot(out_.planes[k].normal, plane.normal);
      if (std::fabs(same) > kSameDirection &&
          std::fabs(out_.planes[k].distance - std::copysign(plane.distance, plane.distance * same)) <
              kSameDistance * size_)
        return plane_of_[triangle] = k;
    }
    out_.planes.push_back(plane);
    out_.plane_records.push_back(records_[triangle]);
    return plane_of_[triangle] = uint32_t(out_.planes.size() - 1);
  }

  glm::vec3 patch_point(const Face& face, uint32_t patch, uint32_t n, float x, float y) const {
    glm::vec3 p;
    p[face.axis] = face.side ? lo_[face.axis] + size_ : lo_[face.axis];
    p[face.u] = lo_[face.u] + size_ * ((float(patch % n) + x) / float(n));
    p[face.v] = lo_[face.v] + size_ * ((float(patch / n) + y) / float(n));
    return p;
  }

  // ---- far table ----

  void fill_far() {
    const uint32_t n = scene_.options.far_patches, patches = n * n;
    out_.far.assign(30u * patches * patches, LSP_ANSWER_EMPTY);
    raster_.emplace(lo_, lo_ + size_, n);
    if (cell_.count <= ShaftRaster::max_triangles(n))
      for (uint32_t i = 0; i < cell_.count; ++i) raster_->add(scene_.triangles[records_[i]], i);
    else
      raster_.reset();
    for (uint32_t in = 0; in < 6; ++in)
      for (uint32_t out = 0; out < 6; ++out)
        for (uint32_t p = 0; in != out && p < patches; ++p)
          fill_row(in, p, out, &out_.far[LSP_SHAFT_INDEX(in, out, p, 0u, n)]);
  }

  // The shafts from one patch to all patches of one face.
  void fill_row(uint32_t in, uint32_t p, uint32_t out, uint16_t* row) {
    const uint32_t n = scene_.options.far_patches, patches = n * n;
    samples_.resize(patches);
    for (auto& s : samples_) s.clear();
    wanted_.clear();
    for (uint32_t q = 0; q < patches; ++q) wanted_.push_back(q);
    const Sequence<4> sequence((number_ * 6 + in) * patches + p);
    const uint32_t all = std::max(kBeforeEmpty, scene_.options.far_samples);
    for (uint32_t i = 0; i < all && !wanted_.empty(); ++i) {
      cast(in, p, out, sequence(i));
      if (i + 1 == kFirst) std::erase_if(wanted_, [&](uint32_t q) { return one_plane(samples_[q]); });
      if (i + 1 == kBeforeEmpty)
        std::erase_if(wanted_, [&](uint32_t q) { return all_miss(samples_[q]) || one_plane(samples_[q]); });
    }
    for (uint32_t q = 0; q < patches; ++q) row[q] = encode(fit_.choose(out_.planes, samples_[q], false));
  }

  static bool all_miss(const std::vector<ShaftSample>& samples) {
    return std::all_of(samples.begin(), samples.end(),
                       [](const ShaftSample& s) { return s.plane == kNoPlane; });
  }
  static bool one_plane(const std::vector<ShaftSample>& samples) {
    return samples[0].plane != kNoPlane &&
           std::all_of(samples.begin(), samples.end(),
                       [&](const ShaftSample& s) { return s.plane == samples[0].plane; });
  }

  void cast(uint32_t in, uint32_t p, uint32_t out, const std::array<float, 4>& r) {
    const uint32_t n = scene_.options.far_patches, patches = n * n;
    const Face face_in(in), face_out(out);
    const glm::vec3 a = patch_point(face_in, p, n, r[0], r[1]);
    ends_.resize(patches);
    t_.resize(patches);
    triangles_.resize(patches);
    for (uint32_t q = 0; q < patches; ++q) ends_[q] = patch_point(face_out, q, n, r[2], r[3]);
    if (raster_) {
      raster_->cast(a, out, r[2], r[3], ends_, t_, triangles_);
    } else {
      rays_.clear();
      for (uint32_t q : wanted_) rays_.push_back({f3(a), 0.0f, f3(ends_[q] - a), 1.0f});
      trace(own_, 0, rays_, hits_);
      for (size_t k = 0; k < wanted_.size(); ++k) {
        t_[wanted_[k]] = hits_[k].t;
        triangles_[wanted_[k]] = hits_[k].primitive;
      }
    }
    for (uint32_t q : wanted_) {
      const uint32_t plane = triangles_[q] == LSP_NONE ? kNoPlane : plane_of(triangles_[q]);
      samples_[q].push_back({{2 * r[0] - 1, 2 * r[1] - 1, 2 * r[2] - 1, 2 * r[3] - 1, 0},
                             a - centre_,
                             ends_[q] - a,
                             t_[q],
                             plane});
    }
  }

  // ---- origin tables ----

  struct Polygon {
    glm::vec3 corner[12];
    int count = 0;
  };

  // What of a triangle lies in a box.
  static Polygon clip(const LspTriangle& t, const glm::vec3& lo, const glm::vec3& hi) {
    Polygon p;
    for (const lsp_float3& v : {t.v0, t.v1, t.v2}) p.corner[p.count++] = vec(v);
    for (int plane = 0; plane < 6 && p.count > 0; ++plane) {
      const int axis = plane / 2;
      const auto inside = [&](const glm::vec3& v) {
        return plane % 2 ? hi[axis] - v[axis] : v[axis] - lo[axis];
      };
      Polygon q;
      for (int i = 0; i < p.count; ++i) {
        const glm::vec3 &a = p.corner[i], &b = p.corner[(i + 1) % p.count];
        const float da = inside(a), db = inside(b);
        if (da >= 0) q.corner[q.count++] = a;
        if ((da > 0 && db < 0) || (da < 0 && db > 0)) q.corner[q.count++] = a + (b - a) * (da / (da - db));
      }
      p = q;
    }
    return p;
  }

  // The surface in a sub-cell as triangles, with their areas summed up.
  struct Surface {
    std::vector<std::array<glm::vec3, 3>> pieces;
    std::vector<glm::vec3> normals;
    std::vector<float> area;
  };

  void gather(const glm::vec3& lo, const glm::vec3& hi, Surface& surface) const {
    surface.pieces.clear();
    surface.normals.clear();
    surface.area.clear();
    float sum = 0;
    for (const LspTriangle& t : local_) {
      const Polygon p = clip(t, lo, hi);
      if (p.count < 3) continue;
      const glm::vec3 normal = glm::cross(vec(t.v1) - vec(t.v0), vec(t.v2) - vec(t.v0));
      const float length = glm::length(normal);
      if (!(length > 0)) continue;
      for (int k = 1; k + 1 < p.count; ++k) {
        const float area = glm::length(glm::cross(p.corner[k] - p.corner[0], p.corner[k + 1] - p.corner[0]));
        if (!(area > 0)) continue;
        sum += area;
        surface.pieces.push_back({p.corner[0], p.corner[k], p.corner[k + 1]});
        surface.normals.push_back(normal / length);
        surface.area.push_back(sum);
      }
    }
  }

  void fill_origin() {
    const int n = int(scene_.options.sub_cells);
    const float edge = size_ / float(n);
    Surface surface;
    for (int s = 0; s < n * n * n; ++s) {
      const glm::vec3 at(float(s % n), float(s / n % n), float(s / n / n));
      const glm::vec3 lo = lo_ + at * edge;
      gather(lo - kSubMargin * edge, lo + (1 + kSubMargin) * edge, surface);
      if (surface.pieces.empty()) continue;
      out_.sub_mask |= uint64_t(1) << s;
      fill_sub_cell(lo, edge, surface, uint32_t(s));
    }
  }

  // Rays from the surface of a sub-cell as a renderer sends them, cosine-distributed from both sides, sorted
  // by the patch of the cell through which they leave.
  void fill_sub_cell(const glm::vec3& lo, float edge, const Surface& surface, uint32_t sub) {
    const uint32_t m = scene_.options.origin_patches, entries = 6 * m * m;
    const uint32_t count = entries * scene_.options.origin_samples;
    const Sequence<5> sequence(number_ * 64 + sub);
    rays_.clear();
    near_.clear();
    for (uint32_t i = 0; i < count; ++i) {
      const auto r = sequence(i);
      const float wanted = r[0] * surface.area.back();
      const size_t piece = std::min(
          size_t(std::upper_bound(surface.area.begin(), surface.area.end(), wanted) - surface.area.begin()),
          surface.area.size() - 1);
      const auto& [a, b, c] = surface.pieces[piece];
      const float root = std::sqrt(r[1]), w1 = root * (1 - r[2]), w2 = root * r[2];
      const glm::vec3 normal = i % 2 ? -surface.normals[piece] : surface.normals[piece];
      const glm::vec3 origin = a + (b - a) * w1 + (c - a) * w2 + normal * scene_.offset;
      add_near(origin, cosine(normal, r[3], r[4]), lo, edge, m);
    }
    trace(own_, 0, rays_, hits_);
    beyond_.clear();
    for (size_t i = 0; i < near_.size(); ++i) {
      NearRay& ray = near_[i];
      const bool hit = hits_[i].primitive != LSP_NONE;
      ray.sample.t = hits_[i].t;
      ray.sample.plane = hit ? plane_of(hits_[i].primitive) : kNoPlane;
      ray.sky = false;
      if (hit) continue;
      ray.beyond = uint32_t(beyond_.size());
      beyond_.push_back(rays_[i]);
      beyond_.back().tmin = 1.0f;
      beyond_.back().tmax = INFINITY;
    }
    trace(scene_.whole, LSP_TRACE_ANY_HIT, beyond_, hits_);
    for (NearRay& ray : near_)
      if (ray.sample.plane == kNoPlane) ray.sky = hits_[ray.beyond].primitive == LSP_NONE;
    std::stable_sort(near_.begin(), near_.end(),
                     [](const NearRay& a, const NearRay& b) { return a.entry < b.entry; });
    const size_t first = out_.origin.size();
    out_.origin.resize(first + entries, uint16_t(LSP_ANSWER_EMPTY | LSP_LOSS_UNKNOWN << LSP_LOSS_SHIFT));
    std::vector<ShaftSample> samples;
    for (size_t i = 0; i < near_.size();) {
      const uint32_t entry = near_[i].entry;
      samples.clear();
      bool sky = true;
      for (; i < near_.size() && near_[i].entry == entry; ++i) {
        samples.push_back(near_[i].sample);
        sky = sky && near_[i].sky;
      }
      uint16_t code;
      if (sky && samples.size() >= kBeforeEmpty) {
        code = LSP_ANSWER_SKY;
      } else {
        Answer answer = fit_.choose(out_.planes, samples, true);
        if (samples.size() < kFirst) answer.loss = 1;  // too few to know
        code = encode(answer);
      }
      out_.origin[first + entry] = code;
    }
  }

  static glm::vec3 cosine(const glm::vec3& n, float a, float b) {
    const float sign = n.z >= 0 ? 1.0f : -1.0f;  // Duff et al. 2017
    const float p = -1 / (sign + n.z), q = n.x * n.y * p;
    const glm::vec3 u(1 + sign * n.x * n.x * p, sign * q, -sign * n.x), v(q, sign + n.y * n.y * p, -n.y);
    const float radius = std::sqrt(a);
    const glm::vec2 turn = circle(b);
    return u * (radius * turn.x) + v * (radius * turn.y) + n * std::sqrt(std::max(0.0f, 1 - a));
  }

  struct NearRay {
    ShaftSample sample;
    uint32_t entry;
    uint32_t beyond;
    bool sky;
  };

  void add_near(const glm::vec3& origin, const glm::vec3& direction, const glm::vec3& lo, float edge,
                uint32_t m) {
    // Where it leaves the cell.
    float way = INFINITY;
    uint32_t axis = 0;
    for (int k = 0; k < 3; ++k) {
      if (direction[k] == 0) continue;
      const float side = direction[k] > 0 ? lo_[k] + size_ : lo_[k];
      const float t = (side - origin[k]) / direction[k];
      if (t < way) {
        way = t;
        axis = uint32_t(k);
      }
    }
    if (!(way > 0) || !std::isfinite(way)) return;
    const uint32_t face = 2 * axis + (direction[int(axis)] > 0 ? 1 : 0);
    const Face f(face);
    const glm::vec3 end = origin + direction * way;
    const auto patch = [&](float x, float& place) {
      const float q = std::clamp(x / size_ * float(m), 0.0f, float(m));
      const uint32_t i = std::min(uint32_t(q), m - 1);
      place = 2 * (q - float(i)) - 1;
      return i;
    };
    NearRay ray;
    const glm::vec3 sub = (origin - lo) * (2 / edge) - 1.0f;
    auto& place = ray.sample.place;
    for (int k = 0; k < 3; ++k) place[size_t(k)] = sub[k];
    const uint32_t u = patch(end[f.u] - lo_[f.u], place[3]);
    const uint32_t v = patch(end[f.v] - lo_[f.v], place[4]);
    ray.entry = face * m * m + u + m * v;
    ray.sample.origin = origin - centre_;
    ray.sample.way = direction * way;
    ray.beyond = 0;
    ray.sky = false;
    near_.push_back(ray);
    rays_.push_back({f3(origin), 0.0f, f3(ray.sample.way), 1.0f});
  }

  // ---- answers ----

  // Splits are numbered behind the planes, whose number is not known yet: from kSplits on for now.
  static constexpr uint32_t kSplits = 0x1000, kTooMany = UINT32_MAX;

  uint16_t encode(const Answer& answer) {
    const uint32_t number = number_of(answer);
    if (number == kTooMany) {
      out_.overflow = true;
      return unknown();
    }
    return uint16_t(number | loss_class(answer.loss) << LSP_LOSS_SHIFT);
  }

  // What an answer is written as: a plane, a split, or LSP_ANSWER_EMPTY.
  uint32_t number_of(const Answer& answer) {
    const auto plane = [](uint32_t p) {
      return p == kNoPlane ? uint32_t(LSP_ANSWER_EMPTY) : p < kSplits ? p : kTooMany;
    };
    const uint32_t a = plane(answer.a), b = plane(answer.b);
    if (a == kTooMany || b == kTooMany) return kTooMany;
    if (!answer.split) return a;
    const auto bits = [&](size_t k) { return uint32_t(answer.weights[k]) & 0x3Fu; };
    LspSplit packed{(a & LSP_SPLIT_MASK) | (b & LSP_SPLIT_MASK) << 12 | bits(kPlaces) << 24, 0};
    for (size_t k = 0; k < kPlaces; ++k) packed.weights |= bits(k) << 6 * k;
    const auto [it, added] = split_numbers_.try_emplace(uint64_t(packed.weights) << 32 | packed.answers,
                                                        uint32_t(out_.splits.size()));
    if (added) {
      if (out_.splits.size() >= LSP_ANSWER_LIMIT - kSplits) {
        split_numbers_.erase(it);
        return kTooMany;
      }
      out_.splits.push_back(packed);
    }
    return kSplits + it->second;
  }

  static uint16_t unknown() { return uint16_t(LSP_ANSWER_EMPTY | LSP_LOSS_UNKNOWN << LSP_LOSS_SHIFT); }

  // Planes that no answer names go, and splits get their numbers.
  void finish() {
    std::vector<uint32_t> number(out_.planes.size(), kNoPlane);
    std::vector<Plane> planes;
    std::vector<uint32_t> records;
    const auto keep = [&](uint32_t plane) {
      if (number[plane] == kNoPlane) {
        number[plane] = uint32_t(planes.size());
        planes.push_back(out_.planes[plane]);
        records.push_back(out_.plane_records[plane]);
      }
      return number[plane];
    };
    for (auto* table : {&out_.far, &out_.origin})
      for (uint16_t& e : *table)
        if (const uint32_t answer = e & LSP_ANSWER_MASK; answer < kSplits)
          e = uint16_t((e & ~LSP_ANSWER_MASK) | keep(answer));
    const auto side = [&](uint32_t answer) { return answer == LSP_SPLIT_EMPTY ? answer : keep(answer); };
    for (LspSplit& s : out_.splits) {
      const uint32_t a = side(s.answers & LSP_SPLIT_MASK), b = side(s.answers >> 12 & LSP_SPLIT_MASK);
      s.answers = (s.answers & 0xFF000000u) | a | b << 12;
    }
    const auto renumber = [&](uint32_t answer) {
      return answer >= kSplits && answer < LSP_ANSWER_LIMIT ? answer - kSplits + uint32_t(planes.size())
                                                            : answer;
    };
    for (auto* table : {&out_.far, &out_.origin})
      for (uint16_t& e : *table) e = uint16_t((e & ~LSP_ANSWER_MASK) | renumber(e & LSP_ANSWER_MASK));
    out_.planes = std::move(planes);
    out_.plane_records = std::move(records);
  }

  const CellScene& scene_;
  const Cell& cell_;
  const uint32_t number_;
  const float size_;
  const glm::vec3 lo_, centre_;
  std::span<const uint32_t> records_;
  AnswerFit fit_;
  FilledCell out_;

  Bvh tree_;
  std::vector<LspTriangle> local_;
  LspHeader header_{};
  lsp_scene own_{};

  std::optional<ShaftRaster> raster_;
  std::vector<uint32_t> plane_of_;  // by triangle of the cell
  std::map<uint64_t, uint32_t> split_numbers_;
  std::vector<std::vector<ShaftSample>> samples_;
  std::vector<uint32_t> wanted_, triangles_;
  std::vector<glm::vec3> ends_;
  std::vector<float> t_;
  std::vector<LspRay> rays_, beyond_;
  std::vector<LspHit> hits_;
  std::vector<NearRay> near_;
};

}  // namespace

FilledCell fill_cell(const CellScene& scene, uint32_t cell) { return Filler(scene, cell).run(); }

}  // namespace lsp
