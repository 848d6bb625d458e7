// The library's own ray set-up, triangle depth and answer (lsp/traverse.h) for the wide tree, which differs
// from the library in the traversal alone.
#pragma once

#include "trace_subset.h"

namespace lsp::bench::wide {

using namespace lsp::subset;

struct Text {
#include "lsp/traverse.h"
};

}  // namespace lsp::bench::wide
