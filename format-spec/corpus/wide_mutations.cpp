// One file for every rule that only wide nodes can break, and one more for the rules of every tree that they
// break in a way of their own. full_wide_scene has nodes 1 and 2 as children 1 and 5 of node 0, and node 3 as
// child 2 of node 1.
#include <cmath>

#include "collector.h"
#include "wide_scenes.h"

namespace lsp::corpus {
namespace {

using format::RuleId;

void wide(Collector& c, RuleId rule, const char* mutation, const std::function<void(Image&)>& change,
          std::vector<std::string> arguments = {}) {
  Image image = full_wide_scene();
  change(image);
  c.add(rule, mutation, encode(image), std::move(arguments), "-wide");
}

void wide_header(Collector& c, RuleId rule, const char* mutation,
                 const std::function<void(LspHeader&)>& change) {
  Bytes bytes = encode(full_wide_scene());
  change(header_of(bytes));
  repair_hashes(bytes);
  c.add(rule, mutation, std::move(bytes), {}, "-wide");
}

void alone_header(Collector& c, RuleId rule, const char* mutation,
                  const std::function<void(LspHeader&)>& change) {
  Bytes bytes = encode(wide_alone_scene());
  change(header_of(bytes));
  repair_hashes(bytes);
  c.add(rule, mutation, std::move(bytes), {}, "-wide-alone");
}

// Wide nodes without cells.
void alone(Collector& c) {
  alone_header(c, RuleId::kBaseStructure, "WIDE_BASE is clear, base_structure is 4",
               [](LspHeader& h) { h.required_features &= ~LSP_FEATURE_WIDE_BASE; });
  alone_header(c, RuleId::kWideNodes, "WIDE_BASE is set, WIDE and EXACT are clear",
               [](LspHeader& h) { h.required_features &= ~(LSP_FEATURE_WIDE | LSP_FEATURE_EXACT); });
  alone_header(c, RuleId::kCellsGrid, "a grid is stated of wide nodes alone",
               [](LspHeader& h) { h.cells = full_wide_scene().header.cells; });
  Bytes counted = encode(wide_alone_scene());
  header_of(counted).plane_count = 7;
  repair_hashes(counted);
  c.add(RuleId::kCellsGrid, "wide nodes alone count seven planes of cells", std::move(counted), {},
        "-wide-alone-counts");
  alone_header(c, RuleId::kQualityRange, "the quality balanced of wide nodes alone heeds a class of loss",
               [](LspHeader& h) { h.quality[0] = 1; });
  Image with_grid = wide_alone_scene();
  with_grid.cell_words = {0};
  c.add(RuleId::kOtherBase, "the file of wide nodes alone has a CGRD", encode(with_grid), {}, "-wide-alone");
  Image with_bvh = wide_alone_scene();
  with_bvh.nodes = full_scene().nodes;
  c.add(RuleId::kOtherBase, "the file of wide nodes alone has a NODE", encode(with_bvh), {},
        "-wide-alone-node");
}

void header_and_table(Collector& c) {
  wide_header(c, RuleId::kMaxStack, "max_stack of wide nodes is 97", [](LspHeader& h) { h.max_stack = 97; });
  wide_header(c, RuleId::kMaxLeaf, "max_leaf_triangles of wide nodes is 17",
              [](LspHeader& h) { h.max_leaf_triangles = 17; });
  wide_header(c, RuleId::kRootReference, "root is a leaf beside wide nodes",
              [](LspHeader& h) { h.root = LSP_LEAF_BIT; });
  wide_header(c, RuleId::kFeatureSection, "the feature bit WIDE is clear",
              [](LspHeader& h) { h.required_features &= ~LSP_FEATURE_WIDE; });
  wide_header(c, RuleId::kAddressable, "wide_node_count is 2^30 + 1",
              [](LspHeader& h) { h.wide_node_count = (1u << 30) + 1; });
  wide_header(c, RuleId::kStepsBound, "max_steps of four wide nodes is 53",
              [](LspHeader& h) { h.max_steps = 53; });
  wide_header(c, RuleId::kWideNodes, "WIDE is set, EXACT is clear", [](LspHeader& h) {
    h.required_features &= ~LSP_FEATURE_EXACT;
    for (uint32_t& dial : h.quality) dial = LSP_HEEDS_TABLES;
  });
  wide_header(c, RuleId::kCountDiffers, "wide_node_count is one more",
              [](LspHeader& h) { h.wide_node_count += 1; });
  {
    Sections sections = to_sections(full_wide_scene());
    std::erase_if(sections.sections, [](const Section& s) { return s.entry.type == LSP_SECTION_WNOD; });
    c.add(RuleId::kMissingSection, "WNOD is left out", encode(sections), {}, "-wide");
  }
  Image bvh = full_scene();
  bvh.wide_nodes = full_wide_scene().wide_nodes;
  c.add(RuleId::kOtherBase, "the file of a BVH has a WNOD too", encode(bvh), {}, "-wide");
}

void nodes(Collector& c) {
  wide(c, RuleId::kChildOutOfRange, "child 1 of node 2 is node 4 of 4", [](Image& i) {
    set_child(i.wide_nodes[2], 1, LSP_WIDE_NODE_BIT);
    set_planes(i.wide_nodes[2], 1, {0, 0, 0, 0, 0, 0});
  });
  wide(c, RuleId::kUnreachable, "WNOD has one element more, which no node names", [](Image& i) {
    i.wide_nodes.push_back(i.wide_nodes.back());
    i.header.max_steps += 1;
  });
  wide(c, RuleId::kNotDepthFirst, "node_first of node 0 is 2",
       [](Image& i) { i.wide_nodes[0].node_first = 2; });
  wide(c, RuleId::kLeafOutOfRange, "the last leaf has two triangles more than there are",
       [](Image& i) { set_child(i.wide_nodes[2], 7, 2u << LSP_WIDE_LEAF_COUNT_SHIFT | 3); });
  wide(c, RuleId::kLeafTooLarge, "max_leaf_triangles of wide nodes is 3",
       [](Image& i) { i.header.max_leaf_triangles = 3; });
  wide(c, RuleId::kLeafOrder, "triangle_first of node 2 is 9",
       [](Image& i) { i.wide_nodes[2].triangle_first = 9; });
  wide(c, RuleId::kTrianglesUnused, "TRIA and NRML of wide nodes have one element more", [](Image& i) {
    i.triangles.push_back(i.triangles.back());
    i.normals.push_back(i.normals.back());
  });
  wide(c, RuleId::kDepthExceeded, "max_depth of wide nodes is 2", [](Image& i) { i.header.max_depth = 2; });
  wide(c, RuleId::kStackExceeded, "max_stack of wide nodes is 2", [](Image& i) { i.header.max_stack = 2; });
  wide(c, RuleId::kStepsExceeded, "max_steps of wide nodes is 10", [](Image& i) { i.header.max_steps = 10; });
  wide(c, RuleId::kBoxOutsideParent, "step.x of node 3 is ten times as long",
       [](Image& i) { i.wide_nodes[3].step.x *= 10; });
  wide(c, RuleId::kBoxNotFinite, "the planes of child 0 of node 0 change places", [](Image& i) {
    set_planes(i.wide_nodes[0], 0, {255, 255, 255, 0, 0, 0});
  });
  wide(c, RuleId::kNodeEmpty, "child 1 of node 2 is node 4, which has no child", [](Image& i) {
    LspWideNode empty{};
    empty.lo = i.wide_nodes[2].lo;
    empty.node_first = 5;
    empty.triangle_first = static_cast<uint32_t>(i.triangles.size());
    for (uint32_t k = 0; k < LSP_WIDE_CHILDREN; ++k) {
      set_child(empty, k, LSP_WIDE_NO_CHILD);
      set_planes(empty, k, {255, 255, 255, 0, 0, 0});
    }
    i.wide_nodes.push_back(empty);
    set_child(i.wide_nodes[2], 1, LSP_WIDE_NODE_BIT);
    set_planes(i.wide_nodes[2], 1, {0, 0, 0, 0, 0, 0});
    i.header.max_steps += 1;
  });
  wide(c, RuleId::kWideFrame, "step.x of node 3 is NaN",
       [](Image& i) { i.wide_nodes[3].step.x = std::nanf(""); });
  wide(c, RuleId::kWideChild, "the second node among the children of node 0 is number 2",
       [](Image& i) { set_child(i.wide_nodes[0], 5, LSP_WIDE_NODE_BIT | 2); });
  wide(c, RuleId::kWideNone, "child 2 of node 0 is none, but has the box of the whole node", [](Image& i) {
    set_planes(i.wide_nodes[0], 2, {0, 0, 0, 255, 255, 255});
  });
}

void geometry(Collector& c) {
  wide(c, RuleId::kTriangleOutsideLeaf, "triangle 3 of wide nodes moves down by 100",
       [](Image& i) {
         for (lsp_float3* v : {&i.triangles[3].v0, &i.triangles[3].v1, &i.triangles[3].v2}) v->y -= 100;
       },
       {"--level", "geometry"});
  wide(c, RuleId::kPrimitiveUncovered, "v0 of triangle 3 of wide nodes moves down by 100",
       [](Image& i) { i.triangles[3].v0.y -= 100; }, {"--level", "geometry"});
}

}  // namespace

void break_wide_nodes(Collector& c) {
  header_and_table(c);
  alone(c);
  nodes(c);
  geometry(c);
}

}  // namespace lsp::corpus
