// A tree of wide nodes: a node's boxes across lanes, and a leaf's triangles. For trace_wide_lanes.cpp.
#if defined(LSP_WIDE_NODES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef LSP_WIDE_NODES_INL_H
#undef LSP_WIDE_NODES_INL_H
#else
#define LSP_WIDE_NODES_INL_H
#endif

#include "wide_rays-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lsp {
namespace HWY_NAMESPACE {
namespace {

// By the axes along which a ray goes up, a bit each: bytes of the planes that it meets first.
constexpr uint8_t kPlanes[8][3] = {{24, 32, 40}, {0, 32, 40}, {24, 8, 40}, {0, 8, 40},
                                   {24, 32, 16}, {0, 32, 16}, {24, 8, 16}, {0, 8, 16}};

// A ray on its way alone.
struct Lone {
  V8 inverse, first_base, last_base;  // in every block of four lanes
  const uint8_t *first, *last;  // by axis the planes that are met first and last: byte of LspWideNode.planes
  float tmin, tmax;
  RayRows rows;

  HWY_INLINE Lone(const Batch& b, size_t i, const LspRay& ray)
      : inverse(hn::LoadDup128(d8, b.inverse[i])),
        first_base(hn::LoadDup128(d8, b.first_base[i])),
        last_base(hn::LoadDup128(d8, b.last_base[i])),
        first(kPlanes[b.forward[i]]),
        last(kPlanes[7 - b.forward[i]]),
        tmin(b.tmin[i]),
        tmax(b.tmax[i]),
        rows(b.rows(i, ray)) {}
};

HWY_INLINE V8 planes_at(const uint8_t* bytes) {
  const hn::Rebind<uint8_t, D8> d_bytes;
  const hn::RebindToSigned<D8> d_int;
  return hn::ConvertTo(d8, hn::PromoteTo(d_int, hn::LoadU(d_bytes, bytes)));
}
HWY_INLINE V8 row_of(const float* row) {
  alignas(16) static constexpr uint32_t kThree[4] = {~0u, ~0u, ~0u, 0};
  // What else is in the row would be a denormal.
  return hn::And(hn::LoadDup128(d8, row), hn::BitCast(d8, hn::LoadDup128(du8, kThree)));
}

// Children of a node that the ray hits between tmin and tmax, a bit each, and where it enters them. To a ray
// from far away boxes that are inside out are as wide as others: there may be no child.
HWY_INLINE uint32_t hit_children(const LspWideNode& node, const Lone& r, V8 tmin, V8 tmax, float* entries) {
  const V8 lo = row_of(&node.lo.x);
  const V8 unit = hn::Mul(row_of(&node.step.x), r.inverse);
  const V8 near = hn::MulAdd(lo, r.inverse, r.first_base), far = hn::MulAdd(lo, r.inverse, r.last_base);
  const auto* bytes = reinterpret_cast<const uint8_t*>(node.planes);
  uint32_t hits = 0;
  for (size_t part = 0; part < kParts; ++part, bytes += kBoxes) {
    const V8 first_x =
        hn::MulAdd(planes_at(bytes + r.first[0]), hn::Broadcast<0>(unit), hn::Broadcast<0>(near));
    const V8 first_y =
        hn::MulAdd(planes_at(bytes + r.first[1]), hn::Broadcast<1>(unit), hn::Broadcast<1>(near));
    const V8 first_z =
        hn::MulAdd(planes_at(bytes + r.first[2]), hn::Broadcast<2>(unit), hn::Broadcast<2>(near));
    const V8 last_x = hn::MulAdd(planes_at(bytes + r.last[0]), hn::Broadcast<0>(unit), hn::Broadcast<0>(far));
    const V8 last_y = hn::MulAdd(planes_at(bytes + r.last[1]), hn::Broadcast<1>(unit), hn::Broadcast<1>(far));
    const V8 last_z = hn::MulAdd(planes_at(bytes + r.last[2]), hn::Broadcast<2>(unit), hn::Broadcast<2>(far));
    const V8 first = max_of(max_of(max_of(tmin, first_x), first_y), first_z);
    const V8 last = min_of(min_of(min_of(tmax, last_x), last_y), last_z);
    hn::Store(first, d8, entries + part * kBoxes);
    hits |= mask_bits(d8, hn::Le(first, last)) << (part * kBoxes);
  }
  return hits;
}

// Of the rays `here`, a bit each, those that hit a child of a node, for each child; returns which children
// are hit. The node's planes are brought to the scene's space once for all rays.
HWY_INLINE uint32_t hit_children(const LspWideNode& node, const Batch& rays, uint32_t here,
                                 uint32_t* by_child) {
  constexpr size_t kSides = 6;
  HWY_ALIGN float planes[kSides * kChildren];
  const auto* bytes = reinterpret_cast<const uint8_t*>(node.planes);
  const float lo[3] = {node.lo.x, node.lo.y, node.lo.z}, step[3] = {node.step.x, node.step.y, node.step.z};
  for (size_t side = 0; side < kSides; ++side)
    for (size_t first = side * kChildren; first < (side + 1) * kChildren; first += kBoxes)
      hn::Store(hn::MulAdd(planes_at(bytes + first), hn::Set(d8, step[side % 3]), hn::Set(d8, lo[side % 3])),
                d8, planes + first);
  hn::Vec<DU8> hit[kParts];
  for (auto& part : hit) part = hn::Zero(du8);
  for (; here != 0; here &= here - 1) {
    const auto i = static_cast<uint32_t>(std::countr_zero(here));
    const uint8_t *first = kPlanes[rays.forward[i]], *last = kPlanes[7 - rays.forward[i]];
    const V8 tmin = hn::Set(d8, rays.tmin[i]), tmax = hn::Set(d8, rays.tmax[i]);
    const auto bit = hn::Set(du8, here & (0u - here));
    for (size_t part = 0; part < kParts; ++part) {
      const auto meet = [&](uint8_t side, const float* base, size_t axis) HWY_ATTR {
        return hn::MulAdd(hn::Load(d8, planes + part * kBoxes + side), hn::Set(d8, rays.inverse[i][axis]),
                          hn::Set(d8, base[axis]));
      };
      V8 in = tmin, out = tmax;
      for (size_t axis = 0; axis < 3; ++axis) {
        in = max_of(in, meet(first[axis], rays.first_base[i], axis));
        out = min_of(out, meet(last[axis], rays.last_base[i], axis));
      }
      hit[part] = hn::Or(hit[part], hn::IfThenElseZero(hn::RebindMask(du8, hn::Le(in, out)), bit));
    }
  }
  uint32_t children = 0;
  for (size_t part = 0; part < kParts; ++part) {
    hn::Store(hit[part], du8, by_child + part * kBoxes);
    children |= mask_bits(du8, hn::Ne(hit[part], hn::Zero(du8))) << (part * kBoxes);
  }
  return children;
}

// The nodes and triangles of a file, which may be damaged. Text is that of single rays (lsp/traverse.h).
template <class Text>
class Tree {
 public:
  explicit Tree(const lsp_scene& scene)
      : scene_(scene),
        nodes_(scene.wide_nodes),
        node_count_(scene.header->wide_node_count),
        triangle_count_(scene.header->triangle_count) {}

  const lsp_scene& scene() const { return scene_; }
  uint32_t most_steps() const { return scene_.header->max_steps; }
  bool empty() const { return node_count_ == 0; }
  const LspWideNode* nodes() const { return nodes_; }

  static HWY_INLINE uint32_t child_of(const LspWideNode& node, uint32_t number) {
    return reinterpret_cast<const uint16_t*>(node.children)[number];
  }

  // The node that a child of another is; null: there is none, or it is not in the file. Where it lies is
  // known sooner from where the first child does.
  HWY_INLINE const LspWideNode* below(const LspWideNode& node, uint32_t child) const {
    const uint32_t number = child & ~LSP_WIDE_NODE_BIT;
    if (child == LSP_WIDE_NO_CHILD || uint64_t{node.node_first} + number >= node_count_) return nullptr;
    // The product has 32 bits: then it is not made one with another of 64.
    static_assert(sizeof(LspWideNode) * LSP_WIDE_NO_CHILD < 0xFFFFFFFFu);
    const uint32_t bytes = number * uint32_t{sizeof(LspWideNode)};
    return reinterpret_cast<const LspWideNode*>(reinterpret_cast<const uint8_t*>(nodes_ + node.node_first) +
                                                bytes);
  }

  // lsp_triangle of a leaf's, four at a time.
  HWY_NOINLINE void hit_leaf(const LspWideNode& node, uint32_t child, const RayRows& r, Best& best) const {
    uint32_t first = (node.triangle_first + (child & LSP_WIDE_LEAF_FIRST_MASK)) & LSP_LEAF_FIRST_MASK;
    uint32_t count = (child >> LSP_WIDE_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK) + 1;
    if (first >= triangle_count_ || count > triangle_count_ - first) return;  // of a damaged file
    for (;; count -= kLeafLanes, first += kLeafLanes) {
      hit_four(first, count < kLeafLanes ? count : kLeafLanes, r, best);
      if (count <= kLeafLanes) return;
    }
  }

  // Before it is known which of its children are hit: of leaves and of nodes those that are likely to be
  // (lines of memory; children lie in the order of what they are worth to any-hit rays).
  HWY_INLINE void ask_for_children(const LspWideNode& node) const {
    const auto ask = [](const void* array, uint64_t bytes, uint32_t lines) HWY_ATTR {
      const uintptr_t first = reinterpret_cast<uintptr_t>(array) + bytes;
      for (uint32_t i = 0; i < lines; ++i) __builtin_prefetch(reinterpret_cast<const void*>(first + 64 * i));
    };
    ask(scene_.triangles, uint64_t{node.triangle_first} * sizeof(LspTriangle), 3);
    ask(nodes_, uint64_t{node.node_first} * sizeof(LspWideNode), 2);
  }

  // What waits is read later, if it is: it comes nearer meanwhile. Sponza 1.14 times as fast with it, the
  // bunny, whose tree is in the cache, the same.
  HWY_INLINE void ask_for(const LspWideNode& node, uint32_t child) const {
    static_assert(sizeof(LspWideNode) == 2 * sizeof(LspTriangle));
    const bool is_node = (child & LSP_WIDE_NODE_BIT) != 0;
    const uint32_t index = is_node ? node.node_first + (child & ~LSP_WIDE_NODE_BIT)
                                   : node.triangle_first + (child & LSP_WIDE_LEAF_FIRST_MASK);
    const auto array =
        is_node ? reinterpret_cast<uintptr_t>(nodes_) : reinterpret_cast<uintptr_t>(scene_.triangles);
    const uintptr_t first = array + (size_t{index} << (is_node ? 1 : 0)) * sizeof(LspTriangle);
    __builtin_prefetch(reinterpret_cast<const void*>(first));
    __builtin_prefetch(reinterpret_cast<const void*>(first + sizeof(LspWideNode) - 1));
  }

 private:
  HWY_INLINE void hit_four(uint32_t first, uint32_t count, const RayRows& r, Best& best) const {
    // Where there are fewer, what follows is read with them and not heeded.
    const LspTriangle* triangles = scene_.triangles + first;
    LspTriangle copies[kLeafLanes];
    if (triangle_count_ - first < kLeafLanes) [[unlikely]]
      triangles = copy_last(first, copies);
    const LspTriangle* const records[kLeafLanes] = {triangles, triangles + 1, triangles + 2, triangles + 3};
    const auto number_of = [&](uint32_t lane) HWY_ATTR { return first + lane; };
    hit_triangles<Text>(scene_, records, count, r, number_of, best);
  }

  // The file's last triangles, from `first` on, and as many more as make four.
  HWY_NOINLINE const LspTriangle* copy_last(uint32_t first, LspTriangle* copies) const {
    for (uint32_t i = 0; i < kLeafLanes; ++i)
      copies[i] = scene_.triangles[first + i < triangle_count_ ? first + i : triangle_count_ - 1];
    return copies;
  }

  const lsp_scene& scene_;
  const LspWideNode* const nodes_;
  const uint32_t node_count_, triangle_count_;
};

// All children but one of every node on a path wait, and a mark below them, and one below a ray that leaves
// its group.
constexpr uint32_t kStack = LSP_MAX_STACK * (kChildren - 1) + 2;

// What is waiting. What it refers to is looked up when it is its turn: most never have one.
struct Waiting {
  union {
    float t;            // of a child, where the ray enters it,
    uint32_t rays;      // or which of a group do, a bit each;
    uint32_t children;  // of a node all children that a lone any-hit ray has yet to visit, a bit each
  } of;
  uint32_t node;  // of a child, 8 * node + child
};
constexpr uint32_t kNoNode = LSP_NONE;

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace lsp
HWY_AFTER_NAMESPACE();

#endif
