// An exact tracer to be measured against: the file's binary tree collapsed into one of eight children a node,
// traversed with SIMD. A good CPU tracer of our own, on the same tree and with the same watertight test as
// the library's, so that what a Line Space saves is not taken from a slow baseline. No part of the product.
//
// Sources. Collapsing: Ylitie, Karras, Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed
// Wide BVHs", 2017. Boxes as arrays of planes chosen by the direction's signs: Afra and Szirmay-Kalos,
// "Stackless Multi-BVH Traversal", 2014; Embree.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "open_file.h"
#include "tracer.h"

namespace lsp::bench {

inline constexpr size_t kWideChildren = 8;
inline constexpr size_t kBlockTriangles = 4;

// 256 bytes. Children in order of decreasing area, so that any-hit rays try the likeliest first. An empty
// slot has a box that nothing hits: lower planes at infinity, upper ones at minus infinity.
//
//   child   bit 31 clear: a node;   set: 1 | blocks - 1 (4 bits) | first TriangleBlock (27 bits)
struct alignas(64) WideNode {
  float plane[6][kWideChildren];  // lo x, y, z, hi x, y, z
  uint32_t child[kWideChildren];
  uint32_t children;
  uint32_t reserved[7];
};
static_assert(sizeof(WideNode) == 256);

// Four triangles of a leaf; unused ones are points, which nothing hits.
struct alignas(16) TriangleBlock {
  float corner[9][kBlockTriangles];  // v0 x, y, z, v1, v2
  uint32_t record[kBlockTriangles];  // LspTriangle
};
static_assert(sizeof(TriangleBlock) == 160);

class WideTree {
 public:
  // `file` is a BVH with an exact tree and outlives the tree. Throws Failure(kUnsupported) otherwise.
  explicit WideTree(const OpenFile& file);

  const lsp_scene& scene() const { return *scene_; }
  std::span<const WideNode> nodes() const { return nodes_; }  // the root first
  std::span<const TriangleBlock> blocks() const { return blocks_; }
  size_t bytes() const;  // of nodes and blocks

  // Exact hits as lsp_trace gives them, t to the bit; of several triangles at one depth another may be named.
  // In this thread.
  void trace(bool any, std::span<const LspRay> rays, std::span<LspHit> hits) const;

 private:
  const lsp_scene* scene_;
  std::vector<WideNode> nodes_;
  std::vector<TriangleBlock> blocks_;
};

std::unique_ptr<Tracer> wide_tracer(const WideTree& tree, unsigned threads);

// The instruction set that the tracer runs with on this machine, "AVX2" for example.
const char* wide_target();

}  // namespace lsp::bench
