// Makes instances ready for rays: inverse transforms, boxes, and a tree over these (binned surface area
// heuristic: Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007).
#include "lsp/lsp_instances.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "error.h"
#include "wide_instances.h"

namespace lsp {
namespace {

// As shaders have it, too: lsp/lsp_instances.glsl.
static_assert(sizeof(lsp_instance) == 60 && sizeof(lsp_instance_record) == 160 &&
              sizeof(lsp_instance_node) == 32 && offsetof(lsp_instance, mask) == 52 &&
              offsetof(lsp_instance_record, inverse) == 64 &&
              offsetof(lsp_instance_record, translation) == 100 &&
              offsetof(lsp_instance_record, translation_rest) == 112);

constexpr double kRounding = 0x1p-24;  // of a float: u in NUMERICS.md

// The caller's memory: records, nodes, wide nodes, and the numbers of the instances in the order of the tree.
constexpr uint64_t kBytesEach =
    sizeof(lsp_instance_record) + 2 * sizeof(lsp_instance_node) + sizeof(uint32_t);

// ---- an instance
// -------------------------------------------------------------------------------------------------

// rows[3][3] * v.
void multiply(const double rows[9], const double v[3], double out[3]) {
  for (int i = 0; i < 3; ++i) out[i] = rows[3 * i] * v[0] + rows[3 * i + 1] * v[1] + rows[3 * i + 2] * v[2];
}

// The inverse of a matrix of three rows. False: there is none in double precision of floats' products, or
// it is beyond single precision.
bool invert(const double m[9], double out[9]) {
  double columns = 1;
  for (int i = 0; i < 3; ++i) columns *= std::sqrt(m[i] * m[i] + m[3 + i] * m[3 + i] + m[6 + i] * m[6 + i]);
  const double cofactors[9] = {
      m[4] * m[8] - m[5] * m[7], m[5] * m[6] - m[3] * m[8], m[3] * m[7] - m[4] * m[6],
      m[2] * m[7] - m[1] * m[8], m[0] * m[8] - m[2] * m[6], m[1] * m[6] - m[0] * m[7],
      m[1] * m[5] - m[2] * m[4], m[2] * m[3] - m[0] * m[5], m[0] * m[4] - m[1] * m[3]};
  const double determinant = m[0] * cofactors[0] + m[1] * cofactors[1] + m[2] * cofactors[2];
  if (!(std::abs(determinant) > columns * 0x1p-40)) return false;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      out[3 * i + k] = cofactors[3 * k + i] / determinant;
      if (!std::isfinite(static_cast<float>(out[3 * i + k]))) return false;
    }
  }
  return true;
}

// The largest sum of magnitudes of a row.
double norm(const double m[9]) {
  double largest = 0;
  for (int i = 0; i < 3; ++i)
    largest = std::max(largest, std::abs(m[3 * i]) + std::abs(m[3 * i + 1]) + std::abs(m[3 * i + 2]));
  return largest;
}

// The box in scene space that holds the asset's box, moved; grown by what a hit may lie outside of it for
// rays from within it. False: it is not finite.
bool find_box(const LspHeader& header, const double linear[9], const double translation[3], double condition,
              lsp_instance_record& record) {
  const lsp_float3 lo = header.bounds_min, hi = header.bounds_max;
  double from[3], to[3], reach = 0;
  std::fill(from, from + 3, std::numeric_limits<double>::infinity());
  std::fill(to, to + 3, -std::numeric_limits<double>::infinity());
  for (uint32_t corner = 0; corner < 8; ++corner) {
    const double at[3] = {corner & 1 ? hi.x : lo.x, corner & 2 ? hi.y : lo.y, corner & 4 ? hi.z : lo.z};
    double moved[3];
    multiply(linear, at, moved);
    for (int i = 0; i < 3; ++i) {
      reach = std::max(reach, std::abs(moved[i]));
      moved[i] += translation[i];
      from[i] = std::min(from[i], moved[i]);
      to[i] = std::max(to[i], moved[i]);
    }
  }
  const double growth = 8 * kRounding * condition * reach;
  for (int i = 0; i < 3; ++i) {
    const double margin =
        growth + 2 * kRounding * std::max(std::abs(from[i]), std::abs(to[i]));  // to floats, too
    record.lo[i] = static_cast<float>(from[i] - margin);
    record.hi[i] = static_cast<float>(to[i] + margin);
    if (!std::isfinite(record.lo[i]) || !std::isfinite(record.hi[i])) return false;
  }
  return true;
}

// What is wrong with the instance, nullptr: nothing.
const char* prepare(const lsp_instance& instance, const LspHeader& header, const double origin[3],
                    lsp_instance_record& record) {
  record = {};
  record.instance = instance;
  for (const float x : instance.transform)
    if (!std::isfinite(x)) return "transform is not finite; give twelve finite numbers";
  double linear[9];
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) linear[3 * i + k] = instance.transform[4 * i + k];
  double inverse[9], translation[3];
  if (!invert(linear, inverse)) return "transform has no inverse; give one that keeps three dimensions";
  std::copy(inverse, inverse + 9, record.inverse);
  multiply(linear, origin, translation);
  for (int i = 0; i < 3; ++i) {
    translation[i] += instance.transform[4 * i + 3];
    record.translation[i] = static_cast<float>(translation[i]);
    record.translation_rest[i] = static_cast<float>(translation[i] - record.translation[i]);
  }
  const double condition = norm(linear) * norm(inverse);
  record.growth = static_cast<float>(kRounding * (16 + 24 * condition));
  if (!find_box(header, linear, translation, condition, record))
    return "transform puts it beyond single precision; bring it nearer";
  return nullptr;
}

// ---- the tree
// ----------------------------------------------------------------------------------------------------

struct Box {
  float lo[3] = {INFINITY, INFINITY, INFINITY};
  float hi[3] = {-INFINITY, -INFINITY, -INFINITY};
  void add(const float from[3], const float to[3]) {
    for (int i = 0; i < 3; ++i) {
      lo[i] = std::min(lo[i], from[i]);
      hi[i] = std::max(hi[i], to[i]);
    }
  }
  double half_area() const {
    const double x = double(hi[0]) - lo[0], y = double(hi[1]) - lo[1], z = double(hi[2]) - lo[2];
    return x < 0 ? 0 : x * y + y * z + z * x;
  }
};

class Builder {
 public:
  Builder(const lsp_instance_record* records, lsp_instance_node* nodes, uint32_t* order)
      : records_(records), nodes_(nodes), order_(order) {}

  void build(uint32_t count) {
    for (uint32_t i = 0; i < count; ++i) order_[i] = i;
    node_count_ = 1;
    make(0, 0, count, 1);
  }

 private:
  static constexpr uint32_t kBins = 16;
  struct Bin {
    Box box;
    uint32_t count = 0;
  };

  // Twice the centre of an instance's box.
  double centre(uint32_t instance, int axis) const {
    return double(records_[instance].lo[axis]) + records_[instance].hi[axis];
  }

  // The node of the instances order_[first, first + count), `depth` nodes below and with the root. Inlined
  // into itself it is three times as long.
  __attribute__((noinline)) void make(uint32_t index, uint32_t first, uint32_t count, uint32_t depth) {
    lsp_instance_node& node = nodes_[index];
    if (count == 1) {
      const lsp_instance_record& record = records_[order_[first]];
      std::copy(record.lo, record.lo + 3, node.lo);
      std::copy(record.hi, record.hi + 3, node.hi);
      node.growth = record.growth;
      node.child = order_[first] | LSP_INSTANCE_BIT;
      return;
    }
    const uint32_t left = split(first, count, depth);
    const uint32_t child = node_count_;
    node_count_ += 2;
    node.child = child;
    make(child, first, left, depth + 1);
    make(child + 1, first + left, count - left, depth + 1);
    Box box;
    box.add(nodes_[child].lo, nodes_[child].hi);
    box.add(nodes_[child + 1].lo, nodes_[child + 1].hi);
    std::copy(box.lo, box.lo + 3, node.lo);
    std::copy(box.hi, box.hi + 3, node.hi);
    node.growth = std::max(nodes_[child].growth, nodes_[child + 1].growth);
  }

  // Puts the instances of the left child first; answers how many there are, at least one and not all.
  uint32_t split(uint32_t first, uint32_t count, uint32_t depth) {
    double lo[3], hi[3];
    for (int axis = 0; axis < 3; ++axis) {
      lo[axis] = hi[axis] = centre(order_[first], axis);
      for (uint32_t i = 1; i < count; ++i) {
        lo[axis] = std::min(lo[axis], centre(order_[first + i], axis));
        hi[axis] = std::max(hi[axis], centre(order_[first + i], axis));
      }
    }
    int axis = 0;
    for (int i = 1; i < 3; ++i)
      if (hi[i] - lo[i] > hi[axis] - lo[axis]) axis = i;
    // Halves wherever the heuristic might make the tree deeper than a ray's stack is.
    const uint32_t levels = static_cast<uint32_t>(std::bit_width(count - 1));
    if (count > 2 && hi[axis] > lo[axis] && depth + 1 + levels < LSP_INSTANCE_DEPTH) {
      const uint32_t left = split_by_area(first, count, axis, lo[axis], hi[axis]);
      if (left > 0 && left < count) return left;
    }
    const auto before = [&](uint32_t a, uint32_t b) {
      const double x = centre(a, axis), y = centre(b, axis);
      return x < y || (x == y && a < b);
    };
    std::nth_element(order_ + first, order_ + first + count / 2, order_ + first + count, before);
    return count / 2;
  }

  uint32_t split_by_area(uint32_t first, uint32_t count, int axis, double lo, double hi) {
    const double scale = kBins / (hi - lo);
    const auto bin_of = [&](uint32_t i) {
      return std::min(static_cast<uint32_t>((centre(i, axis) - lo) * scale), kBins - 1);
    };
    Bin bins[kBins];
    for (uint32_t i = first; i < first + count; ++i) {
      Bin& bin = bins[bin_of(order_[i])];
      bin.box.add(records_[order_[i]].lo, records_[order_[i]].hi);
      ++bin.count;
    }
    double costs[kBins] = {};  // of a split before the bin
    Bin sum;
    for (uint32_t i = kBins; --i > 0;) {
      sum.box.add(bins[i].box.lo, bins[i].box.hi);
      sum.count += bins[i].count;
      costs[i] = sum.box.half_area() * sum.count;
    }
    sum = {};
    uint32_t best = 1;
    for (uint32_t i = 1; i < kBins; ++i) {
      sum.box.add(bins[i - 1].box.lo, bins[i - 1].box.hi);
      sum.count += bins[i - 1].count;
      costs[i] += sum.box.half_area() * sum.count;
      if (costs[i] < costs[best]) best = i;
    }
    uint32_t* const end = order_ + first + count;
    return static_cast<uint32_t>(
        std::partition(order_ + first, end, [&](uint32_t i) { return bin_of(i) < best; }) - (order_ + first));
  }

  const lsp_instance_record* records_;
  lsp_instance_node* nodes_;
  uint32_t* order_;
  uint32_t node_count_ = 0;
};

}  // namespace
}  // namespace lsp

extern "C" uint64_t lsp_instances_bytes(uint32_t count) {
  return count * lsp::kBytesEach + lsp::most_wide_nodes(count) * sizeof(lsp_instance_wide_node);
}

extern "C" lsp_status lsp_instances_build(const lsp_scene* const* assets, uint32_t asset_count,
                                          const lsp_instance* instances, uint32_t count, void* memory,
                                          uint64_t bytes, lsp_instances* out, lsp_error* error) {
  *out = {};
  if (count > LSP_MAX_INSTANCES)
    return lsp::fail(error, LSP_ERROR_LIMIT, 0, "%u instances are more than %u; make several scenes of them",
                     count, LSP_MAX_INSTANCES);
  if (bytes < lsp_instances_bytes(count) || reinterpret_cast<uintptr_t>(memory) % 16 != 0)
    return lsp::fail(error, LSP_ERROR_LIMIT, 0,
                     "%u instances need %llu bytes at a multiple of 16; see lsp_instances_bytes", count,
                     static_cast<unsigned long long>(lsp_instances_bytes(count)));
  if (count == 0) {  // a pipeline for what is placed later is planned from the assets all the same
    *out = {assets, nullptr, nullptr, nullptr, asset_count, 0};
    return lsp::succeed(error);
  }
  auto* const records = static_cast<lsp_instance_record*>(memory);
  auto* const nodes = reinterpret_cast<lsp_instance_node*>(records + count);
  for (uint32_t i = 0; i < count; ++i) {
    const uint32_t asset = instances[i].asset;
    if (asset >= asset_count)
      return lsp::fail(error, LSP_ERROR_INVALID, 0, "instance %u names asset %u of %u; assets count from 0",
                       i, asset, asset_count);
    double origin[3];
    lsp_scene_origin(assets[asset], origin);
    if (const char* fault = lsp::prepare(instances[i], *assets[asset]->header, origin, records[i]);
        fault != nullptr)
      return lsp::fail(error, LSP_ERROR_INVALID, 0, "instance %u: its %s", i, fault);
  }
  auto* const wide = reinterpret_cast<lsp_instance_wide_node*>(nodes + 2 * uint64_t{count});
  auto* const order = reinterpret_cast<uint32_t*>(wide + lsp::most_wide_nodes(count));
  lsp::Builder(records, nodes, order).build(count);
  lsp::widen(nodes, wide);
  *out = {assets, records, nodes, wide, asset_count, count};
  return lsp::succeed(error);
}
