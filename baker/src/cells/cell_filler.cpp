#include "cell_filler.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>

#include "../vectors.h"
#include "answer_fit.h"
#include "box.h"
#include "cell_answers.h"
#include "cell_lines.h"
#include "cell_samples.h"
#include "clip.h"
#include "lsp/lsp.h"
#include "lsp/program.h"
#include "near_rays.h"

namespace lsp {
namespace {

constexpr uint32_t kFirst = 8;         // rays of a shaft that may settle it
constexpr uint32_t kBeforeEmpty = 24;  // rays before a shaft counts as empty
constexpr uint32_t kBeforeSky = 32;    // and before an entry says that a ray meets nothing in the whole scene
constexpr uint32_t kRounds = 8;        // of an origin table; entries that are settled take no more rays
constexpr float kSubMargin = 0.02f;    // of a sub-cell's edge: what comes this close counts as in it

struct Face {
  int axis, u, v, side;
  explicit Face(uint32_t face)
      : axis(int(face / 2)), u(axis == 0 ? 1 : 0), v(axis == 2 ? 1 : 2), side(int(face % 2)) {}
};

// The lines between a patch and all patches of another side. They share their places in the patches and their
// beginnings; the first and the last thing that a line meets answer the shafts of both directions.
struct Row {
  size_t lines;                              // at most
  std::vector<uint32_t> count;               // by patch: lines so far
  std::array<std::vector<float>, 4> place;   // by line
  std::array<std::vector<float>, 3> origin;  // by line
  std::array<std::vector<float>, 3> way;     // by patch and line
  std::vector<float> t_first, t_last;        // by patch and line, t_last from the other end
  std::vector<uint32_t> plane_first, plane_last;

  Row(size_t patches, size_t lines) : lines(lines), count(patches) {
    for (auto& p : place) p.resize(lines);
    for (auto& o : origin) o.resize(lines);
    for (auto* by_patch : {&way[0], &way[1], &way[2], &t_first, &t_last}) by_patch->resize(patches * lines);
    for (auto* planes : {&plane_first, &plane_last}) planes->resize(patches * lines);
  }

  ShaftSamples forward(uint32_t patch) const {
    const size_t at = patch * lines;
    return {count[patch],
            {place[0].data(), place[1].data(), place[2].data(), place[3].data(), nullptr},
            {origin[0].data(), origin[1].data(), origin[2].data()},
            {&way[0][at], &way[1][at], &way[2][at]},
            &t_first[at],
            &plane_first[at],
            false};
  }
  ShaftSamples backward(uint32_t patch) const {
    ShaftSamples s = forward(patch);
    s.place = {place[2].data(), place[3].data(), place[0].data(), place[1].data(), nullptr};
    s.t = &t_last[patch * lines];
    s.plane = &plane_last[patch * lines];
    s.reversed = true;
    return s;
  }

  // All its lines met the same, or all nothing.
  bool settled(uint32_t patch, bool empty_too) const {
    const uint32_t *first = &plane_first[patch * lines], *last = &plane_last[patch * lines];
    const auto all = [&](const uint32_t* planes) {
      return std::all_of(planes, planes + count[patch], [&](uint32_t p) { return p == planes[0]; });
    };
    return (empty_too || first[0] != kNoPlane) && all(first) && all(last);
  }
};

FitOptions fit_options(const CellScene& scene) {
  FitOptions options;
  options.splits = scene.options.splits;
  if (scene.colors.empty()) options.look_weight = 0;
  return options;
}

// Rays that begin in a sub-cell, sorted by entry, each quantity an array by ray.
struct NearSamples {
  std::array<std::vector<float>, kPlaces> place;
  std::array<std::vector<float>, 3> origin, way;
  std::vector<float> t;
  std::vector<uint32_t> plane;

  void resize(size_t count) {
    for (auto& p : place) p.resize(count);
    for (auto& o : origin) o.resize(count);
    for (auto& w : way) w.resize(count);
    t.resize(count);
    plane.resize(count);
  }
  ShaftSamples view(size_t first, size_t count) const {
    ShaftSamples s;
    s.count = count;
    for (size_t k = 0; k < kPlaces; ++k) s.place[k] = &place[k][first];
    for (size_t k = 0; k < 3; ++k) s.origin[k] = &origin[k][first];
    for (size_t k = 0; k < 3; ++k) s.way[k] = &way[k][first];
    s.t = &t[first];
    s.plane = &plane[first];
    return s;
  }
};

// A tree of a cell's triangles, numbered from 0, clipped to the cell.
Bvh tree_of(const CellGrid& grid, std::span<const LspTriangle> triangles, const Cell& cell, Mesh& mesh) {
  for (uint32_t i = 0; i < cell.count; ++i) {
    const LspTriangle& t = triangles[grid.records[cell.first + i]];
    for (const lsp_float3& v : {t.v0, t.v1, t.v2}) mesh.positions.push_back(vec(v));
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  const glm::vec3 lo = grid.corner(cell.at);
  const Box box = {lo - grid.margin, lo + grid.size + grid.margin};
  BvhOptions options;
  options.within = &box;
  options.split_budget =
      std::min(options.split_budget, double(LSP_CELL_MAX_REFERENCES - 1) / double(cell.count) - 1);
  options.heuristic_depth = LSP_MAX_CELL_DEPTH - uint32_t(std::bit_width(LSP_CELL_MAX_REFERENCES));
  return build_bvh(mesh, options);
}

class Filler {
 public:
  Filler(const CellScene& scene, uint32_t cell)
      : scene_(scene),
        cell_(scene.grid.cells[cell]),
        number_(cell),
        size_(scene.grid.size),
        lo_(scene.grid.corner(cell_.at)),
        centre_(lo_ + 0.5f * size_),
        records_(std::span(scene.grid.records).subspan(cell_.first, cell_.count)),
        answers_(scene.triangles, scene.colors, records_, centre_, size_),
        fit_(fit_options(scene), size_),
        row_(size_t(scene.options.far_patches) * scene.options.far_patches,
             std::max(kBeforeEmpty, scene.options.far_samples)) {
    build_tree();
  }

  FilledCell run() {
    fill_far();
    fill_origin();
    answers_.finish(out_.far, out_.origin);
    out_.planes.assign(answers_.planes().begin(), answers_.planes().end());
    out_.plane_records = answers_.plane_records();
    out_.splits = answers_.splits();
    out_.overflow = answers_.overflow();
    return std::move(out_);
  }

 private:
  // The cell's own tree, to trace its near rays in, and as the file has it.
  void build_tree() {
    Mesh mesh;
    Bvh bvh = tree_of(scene_.grid, scene_.triangles, cell_, mesh);
    for (uint32_t i = 0; i < cell_.count; ++i) {
      bounds_.emplace_back();
      for (uint32_t k = 0; k < 3; ++k) bounds_.back().grow(mesh.positions[3 * i + k]);
    }
    out_.tree = compact(bvh, lo_ - scene_.grid.margin, size_ + 2 * scene_.grid.margin);
    tree_ = build_wide_tree(mesh, bvh);
    for (uint32_t& r : out_.tree.references) r = records_[r];
    Box bounds;
    for (uint32_t r : bvh.records) {
      local_.push_back(scene_.triangles[records_[r]]);
      local_.back().primitive = r;
      for (const lsp_float3& v : {local_.back().v0, local_.back().v1, local_.back().v2}) bounds.grow(vec(v));
    }
    header_.required_features = LSP_FEATURE_EXACT | LSP_FEATURE_WIDE;
    set_wide(tree_, header_);
    header_.bounds_min = f3(bounds.lo);
    header_.bounds_max = f3(bounds.hi);
    header_.triangle_count = uint32_t(local_.size());
    own_ = {};
    own_.header = &header_;
    own_.wide_nodes = tree_.nodes.data();
    own_.triangles = local_.data();
  }

  static void trace(const lsp_scene& scene, uint32_t flags, const std::vector<LspRay>& rays,
                    std::vector<LspHit>& hits) {
    hits.resize(rays.size());
    const lsp_trace_options options = {flags, 0, 0, 0};
    if (!rays.empty() &&
        lsp_trace(&scene, &options, rays.data(), hits.data(), rays.size(), nullptr, nullptr) != LSP_OK)
      throw Failure(Exit::kInternal, "", "the tracer refused the baker's own tree");
  }

  glm::vec3 patch_point(const Face& face, uint32_t patch, uint32_t n, float x, float y) const {
    glm::vec3 p;
    p[face.axis] = face.side ? lo_[face.axis] + size_ : lo_[face.axis];
    p[face.u] = lo_[face.u] + size_ * ((float(patch % n) + x) / float(n));
    p[face.v] = lo_[face.v] + size_ * ((float(patch / n) + y) / float(n));
    return p;
  }

  // Into points_: of every patch of a side the same as patch_point.
  void set_points(const Face& face, uint32_t n, float x, float y) {
    points_.resize(n * n);
    for (uint32_t row = 0; row < n; ++row) {
      glm::vec3 p = patch_point(face, row * n, n, x, y);
      for (uint32_t column = 0; column < n; ++column) {
        if (row == 0) columns_[column] = lo_[face.u] + size_ * ((float(column) + x) / float(n));
        p[face.u] = columns_[column];
        points_[row * n + column] = p;
      }
    }
  }

  // ---- far table ----

  void fill_far() {
    const uint32_t n = scene_.options.far_patches, patches = n * n;
    out_.far.assign(30u * patches * patches, LSP_ANSWER_EMPTY);
    columns_.resize(n);
    lines_.emplace(scene_.triangles, records_, Box{lo_, lo_ + size_}, scene_.grid.margin);
    for (uint32_t in = 0; in < 6; ++in)
      for (uint32_t out = in + 1; out < 6; ++out)
        for (uint32_t p = 0; p < patches; ++p) fill_row(in, p, out);
  }

  void fill_row(uint32_t in, uint32_t p, uint32_t out) {
    const uint32_t n = scene_.options.far_patches, patches = n * n;
    std::fill(row_.count.begin(), row_.count.end(), 0);
    wanted_.resize(patches);
    for (uint32_t q = 0; q < patches; ++q) wanted_[q] = q;
    const Sequence<4> sequence((number_ * 6 + in) * patches + p);
    const Face from(in);
    lines_->aim({patch_point(from, p, n, 0, 0), patch_point(from, p, n, 1, 1)}, out);
    for (uint32_t i = 0; i < row_.lines && !wanted_.empty(); ++i) {
      cast(in, p, out, i, sequence(i));
      if (i + 1 == kFirst || i + 1 == kBeforeEmpty)
        std::erase_if(wanted_, [&](uint32_t q) { return row_.settled(q, i + 1 == kBeforeEmpty); });
    }
    for (uint32_t q = 0; q < patches; ++q) {
      out_.far[LSP_SHAFT_INDEX(in, out, p, q, n)] =
          answers_.encode(fit_.choose(answers_.planes(), row_.forward(q), false));
      out_.far[LSP_SHAFT_INDEX(out, in, q, p, n)] =
          answers_.encode(fit_.choose(answers_.planes(), row_.backward(q), false));
    }
  }

  // Line i of the row.
  void cast(uint32_t in, uint32_t p, uint32_t out, uint32_t i, const std::array<float, 4>& r) {
    const uint32_t n = scene_.options.far_patches;
    const Face face_in(in), face_out(out);
    const glm::vec3 a = patch_point(face_in, p, n, r[0], r[1]);
    for (size_t k = 0; k < 4; ++k) row_.place[k][i] = 2 * r[k] - 1;
    for (int k = 0; k < 3; ++k) row_.origin[size_t(k)][i] = a[k] - centre_[k];
    set_points(face_out, n, r[2], r[3]);
    for (size_t begin = 0; begin < wanted_.size(); begin += CellLines::kMost) {
      const auto part = std::span(wanted_).subspan(begin, std::min(CellLines::kMost, wanted_.size() - begin));
      ends_.clear();
      for (uint32_t q : part) ends_.push_back(points_[q]);
      lines_->cast(a, ends_, first_, last_);
      for (size_t j = 0; j < part.size(); ++j) add_line(part[j], i, ends_[j] - a, j);
    }
  }

  // Line i of a shaft of the row, the one that was cast as number j.
  void add_line(uint32_t q, uint32_t i, const glm::vec3& way, size_t j) {
    const size_t at = q * row_.lines + i;
    for (int k = 0; k < 3; ++k) row_.way[size_t(k)][at] = way[k];
    const bool any = first_.triangle[j] != LSP_NONE;
    row_.t_first[at] = first_.t[j];
    row_.t_last[at] = 1 - last_.t[j];
    row_.plane_first[at] = any ? answers_.plane_of(first_.triangle[j]) : kNoPlane;
    row_.plane_last[at] = any ? answers_.plane_of(last_.triangle[j]) : kNoPlane;
    ++row_.count[q];
  }

  // ---- origin tables ----

  void gather(const Box& box, Surface& surface) const {
    surface.pieces.clear();
    surface.normals.clear();
    surface.area.clear();
    float sum = 0;
    const Box reach = {box.lo - scene_.grid.margin, box.hi + scene_.grid.margin};
    for (uint32_t i = 0; i < cell_.count; ++i) {
      if (intersection(bounds_[i], reach).empty()) continue;
      const LspTriangle& t = scene_.triangles[records_[i]];
      const Polygon p = clip(t, box.lo, box.hi);
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
      gather({lo - kSubMargin * edge, lo + (1 + kSubMargin) * edge}, surface);
      if (surface.pieces.empty()) continue;
      out_.sub_mask |= uint64_t(1) << s;
      fill_sub_cell(lo, edge, surface, uint32_t(s));
    }
  }

  // What an entry's rays have met so far.
  struct Entry {
    uint32_t count = 0;
    uint32_t plane = kNoPlane;  // of the first
    bool same = true;           // of all
    bool sky = true;            // none meets anything in the whole scene
    bool settled() const { return same && count >= (sky ? kBeforeSky : kBeforeEmpty); }
  };

  struct NearRay {
    std::array<float, kPlaces> place;
    glm::vec3 origin, way;
    float t;
    uint32_t plane;
    uint32_t entry;
  };

  // By rays from the surface of a sub-cell, sorted by the patch of the cell through which they leave.
  void fill_sub_cell(const glm::vec3& lo, float edge, const Surface& surface, uint32_t sub) {
    const uint32_t m = scene_.options.origin_patches, entries = 6 * m * m;
    const uint32_t in_round = entries * scene_.options.origin_samples / kRounds;
    const Sequence<5> sequence(number_ * 64 + sub);
    const SubCell at = {lo_, size_, lo, edge, m, scene_.offset};
    near_.clear();
    met_.assign(entries, {});
    for (uint32_t round = 0; round < kRounds; ++round) {
      const size_t first = near_.size();
      rays_.clear();
      const uint32_t end = (round + 1) * in_round;
      for (uint32_t i = round * in_round; i < end; i += NearRays::kMost) {
        batch_.make(surface, sequence, i, at);
        add_near(batch_, std::min<size_t>(NearRays::kMost, end - i));
      }
      trace_near(first);
    }
    sort_near(entries);
    size_t begin = 0;
    for (const Entry& e : met_) {
      out_.origin.push_back(entry_of(e, begin));
      begin += e.count;
    }
  }

  uint16_t entry_of(const Entry& e, size_t first) {
    if (e.count == 0) return uint16_t(LSP_ANSWER_EMPTY | LSP_LOSS_UNKNOWN << LSP_LOSS_SHIFT);
    if (e.sky && e.count >= kBeforeSky) return LSP_ANSWER_SKY;
    Answer answer = fit_.choose(answers_.planes(), sorted_.view(first, e.count), true);
    if (e.count < kFirst) answer.loss = 1;  // too few to know
    return answers_.encode(answer);
  }

  // Traces the rays from `first` on through the cell, and what leaves it where all else of its entry saw the
  // sky.
  void trace_near(size_t first) {
    trace(own_, 0, rays_, hits_);
    beyond_.clear();
    leaving_.clear();
    for (size_t i = 0; i < rays_.size(); ++i) {
      NearRay& ray = near_[first + i];
      const bool hit = hits_[i].primitive != LSP_NONE;
      ray.t = hits_[i].t;
      ray.plane = hit ? answers_.plane_of(hits_[i].primitive) : kNoPlane;
      Entry& entry = met_[ray.entry];
      if (entry.count++ == 0) entry.plane = ray.plane;
      entry.same = entry.same && ray.plane == entry.plane;
      entry.sky = entry.sky && !hit;
    }
    for (size_t i = 0; i < rays_.size(); ++i) {
      if (!met_[near_[first + i].entry].sky) continue;
      leaving_.push_back(near_[first + i].entry);
      beyond_.push_back(rays_[i]);
      beyond_.back().tmin = 1.0f;
      beyond_.back().tmax = INFINITY;
    }
    trace(scene_.whole, LSP_TRACE_OCCLUSION, beyond_, hits_);
    for (size_t i = 0; i < leaving_.size(); ++i)
      if (hits_[i].t < INFINITY) met_[leaving_[i]].sky = false;
  }

  // A counting sort by entry.
  void sort_near(uint32_t entries) {
    std::vector<size_t> begin(entries);
    size_t at = 0;
    for (uint32_t e = 0; e < entries; ++e) {
      begin[e] = at;
      at += met_[e].count;
    }
    sorted_.resize(near_.size());
    for (const NearRay& ray : near_) {
      const size_t i = begin[ray.entry]++;
      for (size_t k = 0; k < kPlaces; ++k) sorted_.place[k][i] = ray.place[k];
      for (int k = 0; k < 3; ++k) sorted_.origin[size_t(k)][i] = ray.origin[k];
      for (int k = 0; k < 3; ++k) sorted_.way[size_t(k)][i] = ray.way[k];
      sorted_.t[i] = ray.t;
      sorted_.plane[i] = ray.plane;
    }
  }

  // The rays of a batch up to `count`, to near_ and rays_ unless their entries are settled.
  void add_near(const NearRays& batch, size_t count) {
    for (size_t i = 0; i < count; ++i) {
      const uint32_t entry = batch.entry[i];
      if (entry == NearRays::kNone || met_[entry].settled()) continue;
      NearRay& ray = near_.emplace_back();
      ray.entry = entry;
      for (size_t k = 0; k < kPlaces; ++k) ray.place[k] = batch.place[k][i];
      const glm::vec3 origin(batch.origin[0][i], batch.origin[1][i], batch.origin[2][i]);
      ray.origin = origin - centre_;
      ray.way = {batch.way[0][i], batch.way[1][i], batch.way[2][i]};
      rays_.push_back({f3(origin), 0.0f, f3(ray.way), 1.0f});
    }
  }

  const CellScene& scene_;
  const Cell& cell_;
  const uint32_t number_;
  const float size_;
  const glm::vec3 lo_, centre_;
  std::span<const uint32_t> records_;
  std::vector<Box> bounds_;  // of the cell's triangles
  CellAnswers answers_;
  AnswerFit fit_;
  FilledCell out_;

  WideTree tree_;
  std::vector<LspTriangle> local_;
  LspHeader header_{};
  lsp_scene own_{};

  // Of the row that is being filled.
  std::optional<CellLines> lines_;
  Row row_;
  std::vector<uint32_t> wanted_;  // patches whose shafts are not settled
  std::vector<float> columns_;
  std::vector<glm::vec3> points_;  // where a line ends, by patch
  std::vector<glm::vec3> ends_;    // of lines that are cast at once
  CellLines::Hits first_, last_;   // of these

  // Of the sub-cell that is being filled.
  NearRays batch_;
  std::vector<NearRay> near_;
  std::vector<Entry> met_;
  NearSamples sorted_;
  std::vector<LspRay> rays_, beyond_;
  std::vector<uint32_t> leaving_;  // by ray of beyond_: its entry
  std::vector<LspHit> hits_;
};

}  // namespace

FilledCell fill_cell(const CellScene& scene, uint32_t cell) { return Filler(scene, cell).run(); }

double tests_of_ray(const CellGrid& grid, std::span<const LspTriangle> triangles, uint32_t cell) {
  Mesh mesh;
  const Bvh bvh = tree_of(grid, triangles, grid.cells[cell], mesh);
  const auto triangles_of = [](uint32_t child) {
    return child & LSP_LEAF_BIT ? double((child >> LSP_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK) + 1) : 0;
  };
  const double all = Box{glm::vec3(0), glm::vec3(grid.size)}.half_area();
  double tests = triangles_of(bvh.root);
  for (const LspNode& n : bvh.nodes)
    tests += (Box{vec(n.lo0), vec(n.hi0)}.half_area() * (1 + triangles_of(n.child0)) +
              Box{vec(n.lo1), vec(n.hi1)}.half_area() * (1 + triangles_of(n.child1))) /
             all;
  return tests;
}

}  // namespace lsp
