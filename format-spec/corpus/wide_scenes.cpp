#include "wide_scenes.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cells_scenes.h"

namespace lsp::corpus {
namespace {

struct Box {
  float lo[3] = {std::numeric_limits<float>::max(), std::numeric_limits<float>::max(),
                 std::numeric_limits<float>::max()};
  float hi[3] = {-lo[0], -lo[1], -lo[2]};
  void add(const float* l, const float* h) {
    for (int a = 0; a < 3; ++a) {
      lo[a] = std::min(lo[a], l[a]);
      hi[a] = std::max(hi[a], h[a]);
    }
  }
};

// What a node is made from: a count of triangles is a leaf, `nodes` holds what is a node.
struct Child {
  uint32_t k;
  uint32_t triangles;
  const Child* below;
  uint32_t count;  // of `below`
};

class Builder {
 public:
  explicit Builder(Image& image) : image_(image) { image_.wide_nodes.resize(1); }

  // Fills node `index`, whose place is reserved, and returns its box.
  Box build(uint32_t index, const Child* children, uint32_t count) {
    LspWideNode node{};
    std::fill(std::begin(node.children), std::end(node.children), ~0u);
    for (uint32_t k = 0; k < LSP_WIDE_CHILDREN; ++k) set_planes(node, k, {255, 255, 255, 0, 0, 0});
    node.triangle_first = next_triangle_;
    node.node_first = static_cast<uint32_t>(image_.wide_nodes.size());
    Box boxes[LSP_WIDE_CHILDREN], whole;
    uint32_t nodes = 0;
    for (const Child* c = children; c != children + count; ++c)
      if (c->below == nullptr) {
        set_child(node, c->k,
                  (c->triangles - 1) << LSP_WIDE_LEAF_COUNT_SHIFT | (next_triangle_ - node.triangle_first));
        for (uint32_t i = 0; i < c->triangles; ++i) {
          const LspTriangle& t = image_.triangles[next_triangle_++];
          for (const lsp_float3* v : {&t.v0, &t.v1, &t.v2}) boxes[c->k].add(&v->x, &v->x);
        }
      } else {
        set_child(node, c->k, LSP_WIDE_NODE_BIT | nodes++);
      }
    image_.wide_nodes.resize(image_.wide_nodes.size() + nodes);
    uint32_t next = node.node_first;
    for (const Child* c = children; c != children + count; ++c)
      if (c->below != nullptr) boxes[c->k] = build(next++, c->below, c->count);
    for (const Child* c = children; c != children + count; ++c) whole.add(boxes[c->k].lo, boxes[c->k].hi);
    frame(node, whole);
    for (const Child* c = children; c != children + count; ++c) round_out(node, c->k, boxes[c->k]);
    image_.wide_nodes[index] = node;
    return whole;
  }

 private:
  static void frame(LspWideNode& node, const Box& box) {
    float* lo[3] = {&node.lo.x, &node.lo.y, &node.lo.z};
    float* step[3] = {&node.step.x, &node.step.y, &node.step.z};
    for (int a = 0; a < 3; ++a) {
      *lo[a] = box.lo[a];
      *step[a] = (box.hi[a] - box.lo[a]) / 255;
      while (double(*lo[a]) + 255 * double(*step[a]) < box.hi[a])
        *step[a] = std::nextafter(*step[a], std::numeric_limits<float>::infinity());
    }
  }

  static void round_out(LspWideNode& node, uint32_t k, const Box& box) {
    const float lo[3] = {node.lo.x, node.lo.y, node.lo.z}, step[3] = {node.step.x, node.step.y, node.step.z};
    uint32_t planes[6] = {};
    for (int a = 0; a < 3; ++a) {
      if (step[a] == 0) continue;
      planes[a] = static_cast<uint32_t>(std::floor((double(box.lo[a]) - lo[a]) / step[a]));
      planes[3 + a] = static_cast<uint32_t>(std::ceil((double(box.hi[a]) - lo[a]) / step[a]));
    }
    set_planes(node, k, planes);
  }

  Image& image_;
  uint32_t next_triangle_ = 0;
};

void clear_cells(Image& image) {
  image.cell_words.clear();
  image.filled_cells.clear();
  image.entries.clear();
  image.planes.clear();
  image.plane_records.clear();
  image.splits.clear();
  image.cell_nodes.clear();
  image.cell_references.clear();
}

void need(LspHeader& h) {
  h.required_features |= LSP_FEATURE_WIDE;
  h.version_minor = lsp_version_minor(h.required_features);
  h.root = LSP_NONE;
}

}  // namespace

void set_planes(LspWideNode& node, uint32_t k, const uint32_t (&planes)[6]) {
  for (uint32_t p = 0; p < 6; ++p) {
    uint32_t& word = node.planes[p * 2 + k / 4];
    word = (word & ~(0xFFu << k % 4 * 8)) | planes[p] << k % 4 * 8;
  }
}

void set_child(LspWideNode& node, uint32_t k, uint32_t child) {
  uint32_t& word = node.children[k / 2];
  word = (word & ~(0xFFFFu << k % 2 * 16)) | child << k % 2 * 16;
}

Image full_wide_scene() {
  Image image = full_cells_scene();
  image.nodes.clear();
  LspHeader& h = image.header;
  need(h);
  const Child third[] = {{1, 3, nullptr, 0}};
  const Child first[] = {{0, 2, nullptr, 0}, {2, 0, third, 1}};
  const Child second[] = {{0, 2, nullptr, 0}, {5, 1, nullptr, 0}, {7, 1, nullptr, 0}};
  const Child root[] = {{0, 4, nullptr, 0}, {1, 0, first, 2}, {3, 1, nullptr, 0}, {5, 0, second, 3}};
  Builder(image).build(0, root, 4);
  h.max_depth = h.max_stack = 3;
  h.max_leaf_triangles = 4;
  h.max_steps = 4 + 7;
  return image;
}

Image wide_alone_scene() {
  Image image = full_wide_scene();
  clear_cells(image);
  LspHeader& h = image.header;
  h.base_structure = LSP_BASE_WIDE;
  h.required_features = (h.required_features & ~LSP_FEATURE_CELLS) | LSP_FEATURE_WIDE_BASE;
  h.version_minor = lsp_version_minor(h.required_features);
  h.cells = {};
  for (uint32_t& classes : h.quality) classes = 0;
  for (uint32_t& part : h.quality_part) part = 0;
  return image;
}

Image empty_wide_scene() {
  Image image = full_cells_scene();
  LspHeader& h = image.header;
  need(h);
  h.required_features &= ~(LSP_FEATURE_NORMALS | LSP_FEATURE_MATERIALS);
  h.primitive_count = 0;
  h.bounds_min = h.bounds_max = {0, 0, 0};
  h.max_depth = h.max_steps = h.max_leaf_triangles = 0;
  h.max_stack = 1;
  h.cells.cells_x = 1;
  h.cells.origin_entry_first = 0;
  clear_cells(image);
  image.cell_words = {0};
  image.nodes.clear();
  image.triangles.clear();
  image.normals.clear();
  image.materials.clear();
  return image;
}

}  // namespace lsp::corpus
