// Geometry and materials: triangles, normals, materials, and the boxes around them.
//
// A spatial split puts a triangle into several leaves, each of whose boxes bounds a part of it only. What
// then holds for every leaf is that its box meets the triangle's; and for every primitive, that each of its
// corners lies in the box of one of its leaves.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>

#include "layers.h"
#include "line_space.h"
#include "octahedral.h"
#include "vec.h"
#include "wide.h"

namespace lsp::format {
namespace {

struct Box {
  lsp_float3 lo, hi;
};

bool same(const lsp_float3& a, const lsp_float3& b) { return a.x == b.x && a.y == b.y && a.z == b.z; }

bool contains(const Box& box, const lsp_float3& p, float slack) {
  return p.x >= box.lo.x - slack && p.y >= box.lo.y - slack && p.z >= box.lo.z - slack &&
         p.x <= box.hi.x + slack && p.y <= box.hi.y + slack && p.z <= box.hi.z + slack;
}

bool overlap(const Box& a, const Box& b, float slack) {
  return a.lo.x <= b.hi.x + slack && a.lo.y <= b.hi.y + slack && a.lo.z <= b.hi.z + slack &&
         b.lo.x <= a.hi.x + slack && b.lo.y <= a.hi.y + slack && b.lo.z <= a.hi.z + slack;
}

Box box_of(const LspTriangle& t) {
  return {{std::min({t.v0.x, t.v1.x, t.v2.x}), std::min({t.v0.y, t.v1.y, t.v2.y}),
           std::min({t.v0.z, t.v1.z, t.v2.z})},
          {std::max({t.v0.x, t.v1.x, t.v2.x}), std::max({t.v0.y, t.v1.y, t.v2.y}),
           std::max({t.v0.z, t.v1.z, t.v2.z})}};
}

// Two equal corners, or an area below 1e-14 of the longest edge squared.
bool degenerate(const LspTriangle& t) {
  const Vec a = to_vec(t.v1) - to_vec(t.v0), b = to_vec(t.v2) - to_vec(t.v0), c = to_vec(t.v2) - to_vec(t.v1);
  const Vec normal = cross(a, b);
  const double longest = std::max({dot(a, a), dot(b, b), dot(c, c)});
  return !(0.5 * std::sqrt(dot(normal, normal)) > 1e-14 * longest);
}

constexpr uint64_t kNoLeaf = ~uint64_t{0};

class GeometryCheck {
 public:
  GeometryCheck(const FileView& view, Report& report)
      : view_(view),
        report_(report),
        nodes_(view.elements<LspNode>(Kind::kNode)),
        wide_nodes_(walks_wide(view.header) ? view.elements<LspWideNode>(Kind::kWnod)
                                            : std::span<const LspWideNode>()),
        triangles_(view.elements<LspTriangle>(Kind::kTria)),
        normals_(view.elements<LspCornerNormals>(Kind::kNrml)),
        spaces_(view.elements<LspLineSpace>(Kind::kLspc)) {
    // What clipping at a split plane may round away, in the scene's units.
    const lsp_float3 &lo = view.header.bounds_min, &hi = view.header.bounds_max;
    slack_ = std::ldexp(std::max({std::abs(lo.x), std::abs(lo.y), std::abs(lo.z), std::abs(hi.x),
                                  std::abs(hi.y), std::abs(hi.z)}),
                        -20);
  }

  void run() {
    for (uint64_t i = 0; i < triangles_.size(); ++i) check_triangle(i);
    check_coverage();
    for (uint64_t i = 0; i < normals_.size(); ++i) check_normals(i);
    const std::span<const LspMaterial> materials = view_.elements<LspMaterial>(Kind::kMatl);
    for (uint64_t i = 0; i < materials.size(); ++i) check_material(i, materials[i]);
    leaf_of_.assign(triangles_.size(), kNoLeaf);
    if (walks_wide(view_.header)) {
      for (uint64_t i = 0; i < wide_nodes_.size(); ++i)
        for (uint32_t k = 0; k < LSP_WIDE_CHILDREN; ++k) check_wide_child(i, k);
    } else {
      check_child(view_.header.root, view_.header.root_line_space, kNoLeaf);
      for (uint64_t i = 0; i < nodes_.size(); ++i) {
        check_child(nodes_[i].child0, nodes_[i].line_space0, i * 2);
        check_child(nodes_[i].child1, nodes_[i].line_space1, i * 2 + 1);
      }
    }
    check_primitives();
  }

 private:
  void find_triangle(RuleId id, uint64_t i, const char* field, uint64_t offset, uint64_t bytes,
                     const std::string& message) {
    report_.add(id, view_.offset_of(Kind::kTria, i * sizeof(LspTriangle) + offset),
                view_.length_of(Kind::kTria, bytes), element_path(Kind::kTria, i, field), message);
  }

  void check_triangle(uint64_t i) {
    const LspTriangle& t = triangles_[i];
    const LspHeader& header = view_.header;
    if (!finite(t.v0) || !finite(t.v1) || !finite(t.v2))
      find_triangle(RuleId::kVertexNotFinite, i, nullptr, 0, sizeof t, "a corner is not finite");
    else if (degenerate(t))
      find_triangle(RuleId::kTriangleDegenerate, i, nullptr, 0, sizeof t,
                    "the corners lie on one line or in one point");
    if (t.primitive >= header.primitive_count)
      find_triangle(RuleId::kPrimitiveOutOfRange, i, "primitive", offsetof(LspTriangle, primitive), 4,
                    "is " + std::to_string(t.primitive) + ", primitive_count is " +
                        std::to_string(header.primitive_count));
    if (t.material >= std::max(header.material_count, 1u))
      find_triangle(RuleId::kMaterialOutOfRange, i, "material", offsetof(LspTriangle, material), 4,
                    "is " + std::to_string(t.material) + ", material_count is " +
                        std::to_string(header.material_count));
    if (t.flags & ~(LSP_TRIANGLE_SMOOTH | LSP_TRIANGLE_MAX_GAPS << LSP_TRIANGLE_GAPS_SHIFT))
      find_triangle(RuleId::kTriangleFlags, i, "flags", offsetof(LspTriangle, flags), 4,
                    "an unknown flag is set");
    bool smooth = false;
    if (i < normals_.size()) smooth = normals_[i].n0 != normals_[i].n1 || normals_[i].n0 != normals_[i].n2;
    const bool known = normals_.size() == triangles_.size() || !view_.part(Kind::kNrml).present;
    if (known && smooth != ((t.flags & LSP_TRIANGLE_SMOOTH) != 0))
      find_triangle(RuleId::kSmoothFlag, i, "flags", offsetof(LspTriangle, flags), 4,
                    smooth ? "SMOOTH is clear, but the corner normals differ"
                           : "SMOOTH is set, but the corner normals do not differ");
  }

  // Triangles that are there in part, against the feature and against what their materials say.
  void check_coverage() {
    const bool declared = (view_.header.required_features & LSP_FEATURE_COVERAGE) != 0;
    const std::span<const LspMaterial> materials = view_.elements<LspMaterial>(Kind::kMatl);
    bool any = false;
    for (uint64_t i = 0; i < triangles_.size(); ++i) {
      const LspTriangle& t = triangles_[i];
      const uint32_t gaps = t.flags >> LSP_TRIANGLE_GAPS_SHIFT;
      any = any || gaps != 0;
      if (!declared || t.material >= materials.size()) continue;
      const float missing = 1 - materials[t.material].opacity;
      if (!(std::abs(std::ldexp(static_cast<float>(gaps), -16) - missing) <= 1.0f / 512))
        find_triangle(RuleId::kGapsDiffer, i, "flags", offsetof(LspTriangle, flags), 4,
                      std::to_string(gaps) + " of 65536 rays pass, its material has the opacity " +
                          std::to_string(materials[t.material].opacity));
    }
    const Part& section = view_.part(Kind::kTria);
    if (any != declared && (any || section.usable || !section.present))
      report_.add(RuleId::kCoverageFeature, offsetof(LspHeader, required_features), 4,
                  "/header/required_features",
                  declared ? "COVERAGE is set, but every triangle is solid"
                           : "COVERAGE is clear, but a triangle has gaps");
  }

  void check_normals(uint64_t i) {
    const LspCornerNormals& n = normals_[i];
    if (normal_sound(n.n0) && normal_sound(n.n1) && normal_sound(n.n2)) return;
    report_.add(RuleId::kNormalInvalid, view_.offset_of(Kind::kNrml, i * sizeof n),
                view_.length_of(Kind::kNrml, sizeof n), element_path(Kind::kNrml, i),
                "a component is -32768");
  }

  void check_material(uint64_t i, const LspMaterial& m) {
    const auto color = [](const lsp_float3& c) { return finite(c) && c.x >= 0 && c.y >= 0 && c.z >= 0; };
    const auto unit = [](float v) { return v >= 0.0f && v <= 1.0f; };
    const uint64_t offset = view_.offset_of(Kind::kMatl, i * sizeof m),
                   bytes = view_.length_of(Kind::kMatl, sizeof m);
    if (!color(m.base_color) || !color(m.emission) || !unit(m.opacity) || !unit(m.roughness) ||
        !unit(m.metallic))
      report_.add(RuleId::kMaterialRange, offset, bytes, element_path(Kind::kMatl, i),
                  "a value is out of its range");
    if (m.reserved[0] != 0 || m.reserved[1] != 0 || m.reserved[2] != 0)
      report_.add(RuleId::kMaterialReserved, offset, bytes, element_path(Kind::kMatl, i),
                  "reserved is not zero");
  }

  // The box of a child: `slot` is node * 2 + side, kNoLeaf for the root; of wide nodes node * 8 + child.
  Box slot_box(uint64_t slot) const {
    if (slot == kNoLeaf) return {view_.header.bounds_min, view_.header.bounds_max};
    if (walks_wide(view_.header)) {
      const WideBox box = wide_box(wide_nodes_[slot / LSP_WIDE_CHILDREN], slot % LSP_WIDE_CHILDREN);
      return {rounded(box.lo), rounded(box.hi)};
    }
    const LspNode& node = nodes_[slot / 2];
    return slot % 2 == 0 ? Box{node.lo0, node.hi0} : Box{node.lo1, node.hi1};
  }

  // What rounding to floats moves is below the slack.
  static lsp_float3 rounded(const double (&v)[3]) {
    constexpr double kMost = std::numeric_limits<float>::max();
    const auto round = [kMost](double x) { return static_cast<float>(std::clamp(x, -kMost, kMost)); };
    return {round(v[0]), round(v[1]), round(v[2])};
  }

  void check_wide_child(uint64_t node, uint32_t k) {
    const uint32_t child = wide_child(wide_nodes_[node], k);
    if (child == LSP_WIDE_NO_CHILD || (child & LSP_WIDE_NODE_BIT)) return;
    check_leaf(uint64_t{wide_nodes_[node].triangle_first} + wide_leaf_first(child), wide_leaf_count(child),
               node * LSP_WIDE_CHILDREN + k);
  }

  void check_leaf(uint64_t first, uint64_t count, uint64_t slot) {
    if (!in_range(first, count, triangles_.size())) return;
    const Box box = slot_box(slot);
    for (uint64_t i = first; i < first + count; ++i) {
      leaf_of_[i] = slot;
      if (!overlap(box, box_of(triangles_[i]), slack_))
        find_triangle(RuleId::kTriangleOutsideLeaf, i, nullptr, 0, 48,
                      "the triangle does not meet the box of its leaf");
    }
  }

  void check_child(uint32_t child, uint32_t line_space, uint64_t slot) {
    if (child != LSP_NONE && (child & LSP_LEAF_BIT))
      check_leaf(child & LSP_LEAF_FIRST_MASK, (child >> LSP_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK) + 1,
                 slot);
    const uint64_t index = line_space & LSP_LINE_SPACE_MASK;
    if (line_space == LSP_NONE || index >= spaces_.size()) return;
    check_line_space(index, slot_box(slot));
  }

  void check_line_space(uint64_t i, const Box& node) {
    const LspLineSpace& space = spaces_[i];
    const uint64_t at = i * sizeof space;
    if (!contains({space.lo, space.hi}, node.lo, 0) || !contains({space.lo, space.hi}, node.hi, 0))
      report_.add(RuleId::kLineSpaceNotAround, view_.offset_of(Kind::kLspc, at),
                  view_.length_of(Kind::kLspc, 28), element_path(Kind::kLspc, i, "lo"),
                  "the box does not contain the box of its node");
    const float n = static_cast<float>(shape_of(space.format).resolution);
    const auto right = [&](float scale, float lo, float hi) {
      const float expected = n / (hi - lo);
      return std::abs(scale - expected) <= 1e-6f * expected;
    };
    if (!right(space.scale.x, space.lo.x, space.hi.x) || !right(space.scale.y, space.lo.y, space.hi.y) ||
        !right(space.scale.z, space.lo.z, space.hi.z))
      report_.add(RuleId::kLineSpaceScale, view_.offset_of(Kind::kLspc, at + offsetof(LspLineSpace, scale)),
                  view_.length_of(Kind::kLspc, 12), element_path(Kind::kLspc, i, "scale"),
                  "is not the resolution divided by the box's extent");
  }

  // All records of a primitive together. Whether its leaves cover it can only be asked of an exact file:
  // elsewhere records that no shaft refers to were left out.
  void check_primitives() {
    std::vector<uint32_t> order(triangles_.size());
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
      return triangles_[a].primitive < triangles_[b].primitive;
    });
    for (size_t first = 0; first < order.size();) {
      size_t end = first + 1;
      while (end < order.size() && triangles_[order[end]].primitive == triangles_[order[first]].primitive)
        ++end;
      check_primitive(std::span(order).subspan(first, end - first));
      first = end;
    }
  }

  void check_primitive(std::span<const uint32_t> records) {
    const LspTriangle& t = triangles_[records[0]];
    for (uint32_t i : records.subspan(1)) {
      const LspTriangle& other = triangles_[i];
      if (same(t.v0, other.v0) && same(t.v1, other.v1) && same(t.v2, other.v2) &&
          t.material == other.material && t.flags == other.flags)
        continue;
      find_triangle(RuleId::kPrimitiveDiffers, i, nullptr, 0, sizeof t,
                    "primitive " + std::to_string(t.primitive) + " is another triangle in record " +
                        std::to_string(records[0]));
      return;
    }
    if ((view_.header.required_features & LSP_FEATURE_EXACT) == 0) return;
    for (uint32_t i : records)
      if (leaf_of_[i] == kNoLeaf) return;  // the root's, whose box is that of everything
    for (const lsp_float3* corner : {&t.v0, &t.v1, &t.v2}) {
      const bool covered = std::any_of(records.begin(), records.end(), [&](uint32_t i) {
        return contains(slot_box(leaf_of_[i]), *corner, slack_);
      });
      if (covered) continue;
      find_triangle(RuleId::kPrimitiveUncovered, records[0], nullptr, 0, sizeof t,
                    "a corner lies in none of the boxes of the " + std::to_string(records.size()) +
                        " leaves that hold primitive " + std::to_string(t.primitive));
      return;
    }
  }

  const FileView& view_;
  Report& report_;
  std::span<const LspNode> nodes_;
  std::span<const LspWideNode> wide_nodes_;
  std::span<const LspTriangle> triangles_;
  std::span<const LspCornerNormals> normals_;
  std::span<const LspLineSpace> spaces_;
  std::vector<uint64_t> leaf_of_;  // as slot_box takes it
  float slack_ = 0;
};

}  // namespace

void check_geometry(const FileView& view, Report& report) { GeometryCheck(view, report).run(); }

}  // namespace lsp::format
