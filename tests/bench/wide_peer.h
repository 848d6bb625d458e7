// The wide nodes of a file of cells, made of the BVH of a file with Line Spaces: what its exact rays would be
// on the best tree that we have, so that what a Line Space saves is not taken from a slow baseline.
#pragma once

#include <memory>
#include <vector>

#include "open_file.h"
#include "tracer.h"

namespace lsp::bench {

class WideTree {
 public:
  // `file` is a BVH with an exact tree. Throws Failure(kUnsupported) otherwise.
  explicit WideTree(const OpenFile& file);
  WideTree(const WideTree&) = delete;
  WideTree& operator=(const WideTree&) = delete;

  const lsp_scene& scene() const { return scene_; }
  size_t bytes() const;  // of nodes and triangles

 private:
  LspHeader header_;
  std::vector<LspWideNode> nodes_;
  std::vector<LspTriangle> triangles_;
  std::vector<LspCornerNormals> normals_;
  lsp_scene scene_{};
};

// Exact rays of `tree`, which outlives the tracer.
std::unique_ptr<Tracer> wide_tracer(const WideTree& tree, unsigned threads);

}  // namespace lsp::bench
