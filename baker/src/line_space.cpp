#include "line_space.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <glm/glm.hpp>
#include <numeric>
#include <optional>

#include "lsp/lsp.h"
#include "lsp/program.h"
#include "shaft_raster.h"
#include "triangle_box.h"
#include "vectors.h"

namespace lsp {
namespace {

constexpr uint32_t kFirstSamples = 3;
constexpr float kSettled = 0.01f;  // mean error, in lengths of the shaft, under which a plane is good enough

constexpr uint64_t kBytesPerShaft = 5;  // an entry and its part of a bit word

// One Line Space before it finds its place in the file.
struct Filled {
  LspLineSpace record;
  std::vector<LspBitWord> words;
  std::vector<uint32_t> candidates;
};

// The point of a patch at (x, y) in [0, 1)^2 of it. Faces and patches are numbered as in lsp/layout.h.
glm::vec3 patch_point(const glm::vec3& lo, const glm::vec3& hi, uint32_t face, uint32_t patch, uint32_t n,
                      float x, float y) {
  const int axis = int(face / 2);
  const int u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
  glm::vec3 p;
  p[axis] = face % 2 ? hi[axis] : lo[axis];
  p[u] = lo[u] + (hi[u] - lo[u]) * ((float(patch % n) + x) / float(n));
  p[v] = lo[v] + (hi[v] - lo[v]) * ((float(patch / n) + y) / float(n));
  return p;
}

// Where the rays of a shaft start and end in its patches: the centroids first, then a four-dimensional
// low-discrepancy sequence (Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences", 2018).
struct Sample {
  float in_x, in_y, out_x, out_y;
};

std::vector<Sample> shaft_samples(uint32_t count) {
  constexpr double kRoot = 1.1673039782614187;  // of x^5 = x + 1
  std::vector<Sample> samples = {{0.5f, 0.5f, 0.5f, 0.5f}};
  for (uint32_t i = 1; i < count; ++i) {
    double f[4], a = 1;
    for (double& x : f) {
      a /= kRoot;
      x = 0.5 + i * a;
      x -= std::floor(x);
    }
    samples.push_back({float(f[0]), float(f[1]), float(f[2]), float(f[3])});
  }
  return samples;
}

// Fills one Line Space: for every shaft the triangle that the ray from the centroid of its start patch to the
// centroid of its end patch hits first (paper, section 3.1).
class Filler {
 public:
  Filler(const Bvh& bvh, const LspHeader& header, std::span<const LspTriangle> triangles,
         const LineSpaceSite& site, const LineSpaceOptions& options)
      : header_(header), options_(options), site_(site) {
    header_.base_structure = LSP_BASE_BVH;
    header_.root = site.subtree;
    header_.root_line_space = LSP_NONE;
    header_.bounds_min = site.subtree_lo;
    header_.bounds_max = site.subtree_hi;
    header_.required_features = LSP_FEATURE_EXACT;
    header_.node_count = uint32_t(bvh.nodes.size());
    header_.triangle_count = uint32_t(triangles.size());
    scene_.header = &header_;
    scene_.nodes = bvh.nodes.data();
    scene_.triangles = triangles.data();

    // A flat box gets a thickness, and geometry on a side of the box comes to lie inside: far more than the
    // rounding of a passage (lsp/traverse.h), far less than a patch.
    const glm::vec3 lo = vec(site.lo), hi = vec(site.hi);
    binary_ = options.kind == LineSpaceKind::kBinary && !holds_gaps(site.subtree);
    const glm::vec3 extent = hi - lo;
    const glm::vec3 reach = glm::max(glm::abs(lo), glm::abs(hi));
    const float margin = std::max({extent.x, extent.y, extent.z}) * 1e-4f +
                         std::max({reach.x, reach.y, reach.z}) * 3.8146973e-6f;
    lo_ = lo - margin;
    hi_ = hi + margin;
  }

  Filled run() {
    const uint32_t n = options_.resolution;
    const uint32_t shafts = (binary_ ? 15 : 30) * n * n * n * n;
    std::vector<uint32_t> hit(shafts, LSP_NONE);
    const uint32_t patches = n * n;
    samples_ = shaft_samples(binary_ ? 1 : options_.samples);
    every_patch_.resize(patches);
    std::iota(every_patch_.begin(), every_patch_.end(), 0u);
    raster_.emplace(lo_, hi_, n);
    if (!gather(site_.subtree)) raster_.reset();
    for (uint32_t in = 0; in < 6; ++in)
      for (uint32_t out = binary_ ? in + 1 : 0; out < 6; ++out) {
        if (in == out) continue;
        aim(out);
        for (uint32_t p = 0; p < patches; ++p) {
          const uint32_t base =
              binary_ ? LSP_SHAFT_INDEX_SYMMETRIC(in, out, p, 0u, n) : LSP_SHAFT_INDEX(in, out, p, 0u, n);
          fill_row(in, p, out, &hit[base]);
        }
      }
    return pack(hit);
  }

 private:
  // Whether a triangle that reaches into the box of the site is there in part.
  bool holds_gaps(uint32_t child) const {
    const auto apart = [&](const lsp_float3& l, const lsp_float3& h) {
      return l.x > site_.hi.x || l.y > site_.hi.y || l.z > site_.hi.z || h.x < site_.lo.x ||
             h.y < site_.lo.y || h.z < site_.lo.z;
    };
    if (!(child & LSP_LEAF_BIT)) {
      const LspNode& node = scene_.nodes[child];
      return (!apart(node.lo0, node.hi0) && holds_gaps(node.child0)) ||
             (!apart(node.lo1, node.hi1) && holds_gaps(node.child1));
    }
    const uint32_t first = child & LSP_LEAF_FIRST_MASK;
    const uint32_t count = (child >> LSP_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK) + 1;
    return std::any_of(&scene_.triangles[first], &scene_.triangles[first] + count, has_gaps);
  }

  // The triangles that reach into the box, for the raster; false when they are too many for it.
  bool gather(uint32_t child) {
    const auto apart = [&](const lsp_float3& l, const lsp_float3& h) {
      return l.x > hi_.x || l.y > hi_.y || l.z > hi_.z || h.x < lo_.x || h.y < lo_.y || h.z < lo_.z;
    };
    if (!(child & LSP_LEAF_BIT)) {
      const LspNode& node = scene_.nodes[child];
      return (apart(node.lo0, node.hi0) || gather(node.child0)) &&
             (apart(node.lo1, node.hi1) || gather(node.child1));
    }
    const uint32_t first = child & LSP_LEAF_FIRST_MASK;
    for (uint32_t i = first; i <= first + (child >> LSP_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK); ++i) {
      if (!reaches_into(scene_.triangles[i], glm::dvec3(lo_), glm::dvec3(hi_))) continue;
      if (raster_->size() == ShaftRaster::max_triangles(options_.resolution)) return false;
      raster_->add(scene_.triangles[i], i);
    }
    return true;
  }

  // Where the rays to the patches of a face end, by sample and patch.
  void aim(uint32_t face) {
    const uint32_t n = options_.resolution, patches = n * n;
    ends_.resize(samples_.size() * patches);
    for (size_t i = 0; i < samples_.size(); ++i)
      for (uint32_t q = 0; q < patches; ++q)
        ends_[i * patches + q] = patch_point(lo_, hi_, face, q, n, samples_[i].out_x, samples_[i].out_y);
  }

  // What the rays of one sample hit, and where: those to the given patches of a face, or, where it costs no
  // more, those to all.
  void cast(uint32_t sample, uint32_t face, std::span<const uint32_t> wanted) {
    const size_t patches = size_t(options_.resolution) * options_.resolution;
    const std::span t = std::span(t_).subspan(sample * patches, patches);
    const std::span records = std::span(records_).subspan(sample * patches, patches);
    const std::span ends = std::span(ends_).subspan(sample * patches, patches);
    const glm::vec3& a = origins_[sample];
    if (raster_) {
      raster_->cast(a, face, samples_[sample].out_x, samples_[sample].out_y, ends, {t, records});
      return;
    }
    rays_.clear();
    hits_.resize(wanted.size());
    for (uint32_t q : wanted) rays_.push_back({f3(a), 0.0f, f3(ends[q] - a), 1.0f});
    const lsp_trace_options trace = {binary_ ? LSP_TRACE_ANY_HIT : 0u, 0.0f};
    if (lsp_trace(&scene_, &trace, rays_.data(), hits_.data(), rays_.size(), nullptr, nullptr) != LSP_OK)
      throw Failure(Exit::kInternal, "", "the tracer refused the baker's own tree");
    for (size_t i = 0; i < wanted.size(); ++i) {
      t[wanted[i]] = hits_[i].t;
      records[wanted[i]] = hits_[i].primitive;
    }
  }

  // The shafts from one patch to all patches of one face. The first rays of a shaft often settle it: all
  // miss, or one plane answers them all; only the others heed the remaining samples.
  void fill_row(uint32_t in, uint32_t p, uint32_t out, uint32_t* row) {
    const uint32_t patches = options_.resolution * options_.resolution;
    const uint32_t all = uint32_t(samples_.size()), first = std::min(all, kFirstSamples);
    origins_.clear();
    for (const Sample& s : samples_)
      origins_.push_back(patch_point(lo_, hi_, in, p, options_.resolution, s.in_x, s.in_y));
    t_.resize(size_t(all) * patches);
    records_.resize(size_t(all) * patches);
    for (uint32_t i = 0; i < first; ++i) cast(i, out, every_patch_);
    if (all == 1) {
      std::copy_n(records_.begin(), patches, row);
      return;
    }
    unsettled_.clear();
    for (uint32_t q = 0; q < patches; ++q) {
      float cost;
      row[q] = choose(q, first, cost);
      if (first < all && cost > kSettled * float(first)) unsettled_.push_back(q);
    }
    if (unsettled_.empty()) return;
    for (uint32_t i = first; i < all; ++i) cast(i, out, unsettled_);
    for (uint32_t q : unsettled_) {
      float cost;
      row[q] = choose(q, all, cost);
    }
  }

  // The triangle among those hit, or none, whose plane answers the first `count` rays with the smallest sum
  // of errors: the distance along the ray where both hit, all of it where only one does.
  uint32_t choose(uint32_t q, uint32_t count, float& best_cost) const {
    const size_t patches = size_t(options_.resolution) * options_.resolution;
    const auto record = [&](uint32_t i) { return records_[i * patches + q]; };
    bool alike = true;
    best_cost = 0;
    for (uint32_t i = 0; i < count; ++i) {
      alike = alike && record(i) == record(0);
      best_cost += record(i) != LSP_NONE ? 1.0f : 0.0f;
    }
    if (alike) {
      best_cost = 0;
      return record(0);
    }
    // A candidate with gaps sends the rays into the node (lsp/traverse.h): no plane answers them better.
    for (uint32_t i = 0; i < count && options_.exact; ++i)
      if (record(i) != LSP_NONE && has_gaps(scene_.triangles[record(i)])) {
        best_cost = 0;
        return record(i);
      }
    uint32_t best = LSP_NONE;
    for (uint32_t c = 0; c < count; ++c) {
      if (record(c) == LSP_NONE) continue;
      const LspTriangle& tri = scene_.triangles[record(c)];
      const glm::vec3 v0 = vec(tri.v0);
      const glm::vec3 n = glm::cross(vec(tri.v1) - v0, vec(tri.v2) - v0);
      float cost = 0;
      for (uint32_t i = 0; i < count && cost < best_cost; ++i) {
        const glm::vec3& a = origins_[i];
        const float t = glm::dot(v0 - a, n) / glm::dot(ends_[i * patches + q] - a, n);
        const bool plane_hit = t >= 0 && t <= 1;
        const bool hit = record(i) != LSP_NONE;
        if (plane_hit && hit)
          cost += std::fabs(t - t_[i * patches + q]);
        else if (plane_hit != hit)
          cost += 1;
      }
      if (cost < best_cost) {
        best_cost = cost;
        best = record(c);
      }
    }
    return best;
  }

  Filled pack(const std::vector<uint32_t>& hit) const {
    const uint32_t n = options_.resolution;
    const uint32_t shafts = uint32_t(hit.size());
    const uint32_t filled = uint32_t(shafts - size_t(std::count(hit.begin(), hit.end(), LSP_NONE)));
    uint32_t first = site_.triangle_first, count = site_.triangle_count;
    if (count == 0 && filled > 0) {
      first = *std::min_element(hit.begin(), hit.end());
      uint32_t last = first;
      for (uint32_t t : hit) last = t == LSP_NONE ? last : std::max(last, t);
      count = last - first + 1;
    }
    const uint32_t bytes = binary_ ? 0 : count < 0xFF ? 1 : count < 0xFFFF ? 2 : 4;
    const uint32_t word_count = (shafts + 31) / 32;
    // Section 3.1: the sparse layout costs two words per 32 shafts, the dense one an entry per empty shaft.
    const bool dense = !binary_ && uint64_t(shafts) * bytes <
                                       uint64_t(word_count) * sizeof(LspBitWord) + uint64_t(filled) * bytes;

    Filled result;
    const glm::vec3 scale = float(n) / (hi_ - lo_);
    result.record = {f3(lo_),
                     0,
                     f3(hi_),
                     0,
                     f3(scale),
                     first,
                     n | bytes << LSP_FORMAT_ENTRY_SHIFT | (dense ? LSP_FORMAT_DENSE : 0) |
                         (binary_ ? LSP_FORMAT_SYMMETRIC : 0),
                     filled,
                     count,
                     site_.child};
    if (!dense) {
      result.words.resize(word_count);
      uint32_t offset = 0;
      for (uint32_t w = 0; w < word_count; ++w) {
        uint32_t bits = 0;
        for (uint32_t b = 0; b < 32 && w * 32 + b < shafts; ++b)
          if (hit[w * 32 + b] != LSP_NONE) bits |= 1u << b;
        result.words[w] = {bits, offset};
        offset += uint32_t(std::popcount(bits));
      }
    }
    if (!binary_) {
      const uint32_t entries = dense ? shafts : filled;
      const uint32_t per_word = 4 / bytes;
      result.candidates.assign((entries + per_word - 1) / per_word, 0);
      uint32_t entry = 0;
      for (uint32_t s = 0; s < shafts; ++s) {
        if (hit[s] == LSP_NONE && !dense) continue;
        const uint32_t mask = bytes == 4 ? LSP_NONE : (1u << bytes * 8) - 1;
        const uint32_t value = hit[s] == LSP_NONE ? mask : hit[s] - first;
        result.candidates[entry / per_word] |= value << (entry % per_word) * bytes * 8;
        ++entry;
      }
    }
    return result;
  }

  LspHeader header_;
  const LineSpaceOptions& options_;
  const LineSpaceSite& site_;
  lsp_scene scene_{};
  glm::vec3 lo_, hi_;
  bool binary_ = false;  // and symmetric
  std::vector<Sample> samples_;
  std::optional<ShaftRaster> raster_;  // none: too many triangles, the rays are traced
  // The row being filled.
  std::vector<glm::vec3> origins_;  // by sample
  std::vector<glm::vec3> ends_;     // by sample and patch
  std::vector<float> t_;            // by sample and patch
  std::vector<uint32_t> records_;   // likewise
  std::vector<uint32_t> every_patch_, unsettled_;
  std::vector<LspRay> rays_;
  std::vector<LspHit> hits_;
};

}  // namespace

LineSpaces fill_line_spaces(const Bvh& bvh, const LspHeader& header, std::span<const LspTriangle> triangles,
                            const std::vector<LineSpaceSite>& sites, const LineSpaceOptions& options,
                            std::vector<uint32_t>& references, const std::function<void(double)>& progress) {
  // The tracer answers with primitives; here it is to answer with records.
  std::vector<LspTriangle> numbered(triangles.begin(), triangles.end());
  for (size_t i = 0; i < numbered.size(); ++i) numbered[i].primitive = uint32_t(i);

  LineSpaces all;
  if (!options.folder.empty()) {
    all.words.keep_in_file(options.folder);
    all.candidates.keep_in_file(options.folder);
  }
  const uint32_t n = options.resolution;
  const auto shafts_of = [n](bool symmetric) { return (symmetric ? 15ull : 30ull) * n * n * n * n; };
  const uint64_t shafts = shafts_of(options.kind == LineSpaceKind::kBinary);
  references.assign(sites.size(), LSP_NONE);
  // A batch at a time, so that no more than one is in memory twice.
  const size_t batch_sites = size_t(std::max<uint64_t>(2, options.batch_bytes / (shafts * kBytesPerShaft)));
  std::vector<Filled> filled(std::min(batch_sites, sites.size()));
  std::atomic<size_t> done{0};
  for (size_t i = 0; i < sites.size(); ++i) {
    if (i % batch_sites == 0) {
      const size_t end = std::min(i + batch_sites, sites.size());
      tbb::parallel_for(i, end, [&](size_t k) {
        filled[k - i] = Filler(bvh, header, numbered, sites[k], options).run();
        const size_t now = ++done;
        if (progress && now % 16 == 0) progress(double(now) / double(sites.size()));
      });
    }
    Filled& f = filled[i % batch_sites];
    if (f.record.filled == 0) {
      ++all.dropped;
      continue;
    }
    if (all.words.size() + f.words.size() > LSP_NONE ||
        all.candidates.size() + f.candidates.size() > LSP_NONE)
      throw Failure(Exit::kLimit, "",
                    "the Line Spaces need more than 2^32 words, lower --resolution or --depth");
    f.record.word_first = f.words.empty() ? 0 : uint32_t(all.words.size());
    f.record.candidate_first = f.candidates.empty() ? 0 : uint32_t(all.candidates.size());
    all.words.append(f.words);
    all.candidates.append(f.candidates);
    all.shafts += shafts_of((f.record.format & LSP_FORMAT_SYMMETRIC) != 0);
    all.filled += f.record.filled;
    all.dense += (f.record.format & LSP_FORMAT_DENSE) ? 1 : 0;
    references[i] = uint32_t(all.records.size()) | LSP_TERMINAL_BIT;
    all.records.push_back(f.record);
    f = {};
  }
  for (size_t i = 0; i < sites.size(); ++i)
    if (references[i] != LSP_NONE)
      for (size_t above = sites[i].parent; above != kNoSite; above = sites[above].parent)
        if (references[above] != LSP_NONE) references[above] &= ~LSP_TERMINAL_BIT;
  return all;
}

}  // namespace lsp
