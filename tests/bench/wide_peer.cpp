#include "wide_peer.h"

#include <numeric>

#include "lsp/in_chunks.hpp"
#include "lsp/program.h"
#include "vectors.h"
#include "wide_tree.h"

namespace lsp::bench {
namespace {

class WideTracer : public Tracer {
 public:
  WideTracer(const WideTree& tree, unsigned threads) : tree_(tree), threads_(threads) {}
  std::string name() const override { return "wide tree"; }
  double trace(const Mode& mode, std::span<const LspRay> rays, std::span<LspHit> hits) override {
    const lsp_trace_options options = Mode{.any = mode.any}.options();
    return run_in_chunks(rays.size(), threads_, [&](size_t first, size_t count) {
      lsp_error error;
      if (lsp_trace(&tree_.scene(), &options, &rays[first], &hits[first], count, nullptr, &error) != LSP_OK)
        throw Failure(Exit::kInternal, "", std::string("the wide tree is refused: ") + error.message);
    });
  }

 private:
  const WideTree& tree_;
  unsigned threads_;
};

}  // namespace

WideTree::WideTree(const OpenFile& file) : header_(*file.scene().header) {
  const lsp_scene& from = file.scene();
  if (!file.has_exact_tree() || header_.base_structure != LSP_BASE_BVH)
    throw Failure(Exit::kUnsupported, file.path().string(), "has no exact BVH that could be made wide");
  Mesh mesh;
  for (uint32_t i = 0; i < header_.triangle_count; ++i) {
    const LspTriangle& t = from.triangles[i];
    for (const lsp_float3& corner : {t.v0, t.v1, t.v2}) mesh.positions.push_back(vec(corner));
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  Bvh bvh;
  bvh.nodes.assign(from.nodes, from.nodes + header_.node_count);
  bvh.records.resize(header_.triangle_count);
  std::iota(bvh.records.begin(), bvh.records.end(), 0u);
  bvh.root = header_.root;
  lsp::WideTree tree = build_wide_tree(mesh, bvh);
  for (const uint32_t record : bvh.records) {
    triangles_.push_back(from.triangles[record]);
    if (from.normals != nullptr) normals_.push_back(from.normals[record]);
  }
  set_wide(tree, header_);
  header_.required_features |= LSP_FEATURE_WIDE;
  nodes_ = std::move(tree.nodes);
  scene_.header = &header_;
  scene_.wide_nodes = nodes_.data();
  scene_.triangles = triangles_.data();
  scene_.normals = normals_.empty() ? nullptr : normals_.data();
}

size_t WideTree::bytes() const {
  return nodes_.size() * sizeof(LspWideNode) + triangles_.size() * sizeof(LspTriangle);
}

std::unique_ptr<Tracer> wide_tracer(const WideTree& tree, unsigned threads) {
  return std::make_unique<WideTracer>(tree, threads);
}

}  // namespace lsp::bench
