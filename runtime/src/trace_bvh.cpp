#include "trace_group.h"
#include "trace_variant.h"

namespace lsp::LSP_VARIANT {
namespace {

using namespace subset;

struct BvhTraversal {
#include "lsp/traverse.h"

  LSP_STEP void fetch_leaf(const lsp_scene& scene) const {
    const uint32_t first = lsp_walk.ref & LSP_LEAF_FIRST_MASK;
    for (uint32_t i = 0; i < 3; ++i) fetch(scene.triangles, first + i);
  }
  LSP_STEP void fetch_triangles(const lsp_scene&) const {}
};

}  // namespace

const TraceLoops kBvhLoops = {trace_singly<BvhTraversal>, trace_group<BvhTraversal>};

}  // namespace lsp::LSP_VARIANT
