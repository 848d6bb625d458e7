#include "trace_group.h"
#include "trace_variant.h"

namespace lsp::LSP_VARIANT {
namespace {

using namespace subset;

struct NTreeTraversal {
#define LSP_NTREE
#include "lsp/traverse.h"
#undef LSP_NTREE

  static constexpr auto trace_far = partial::trace_far_in_ntree;

  LSP_STEP void fetch_leaf(const lsp_scene& scene) const {
    fetch(scene.references, lsp_walk.ref & ~LSP_LEAF_BIT);
  }
  LSP_STEP void fetch_triangles(const lsp_scene& scene) {
    constexpr uint32_t kAhead = 8;  // triangles of a leaf that are asked for before its test
    const uint32_t count = lsp_ntree_leaf_count(scene);
    for (uint32_t i = 0; i < count && i < kAhead; ++i)
      fetch(scene.triangles, lsp_load_reference(scene, (lsp_walk.ref & ~LSP_LEAF_BIT) + i));
  }
};

}  // namespace

const TraceLoops kNTreeLoops = {trace_singly<NTreeTraversal>, trace_group<NTreeTraversal>};

}  // namespace lsp::LSP_VARIANT
