// Exact rays of a scene with wide nodes, one after the other: those that are counted, those of scenes with
// triangles that are there in part, and all where there are no vectors. The others go through
// trace_wide_lanes.cpp.
#include "trace_group.h"
#include "trace_variant.h"

namespace lsp::LSP_VARIANT {
namespace {

using namespace subset;

struct WideTraversal {
#define LSP_WIDE
#include "lsp/traverse.h"
#undef LSP_WIDE
};

}  // namespace

const WideLoops kWideLoops = {
    {trace_singly<WideTraversal, 0>, trace_singly<WideTraversal, LSP_TRACE_ANY_HIT>}};

}  // namespace lsp::LSP_VARIANT
