// What is checked before anything is traced.
#pragma once

#include "lsp/lsp.h"

namespace lsp {

// Refuses flags and qualities that the library does not know, LSP_ERROR_UNSUPPORTED, and numbers that say
// nothing, LSP_ERROR_INVALID; with *error.
lsp_status check_options(const lsp_trace_options& options, lsp_error* error);

// Whether `options` has the scene's tables answer.
inline bool is_approximate(const lsp_scene& scene, const lsp_trace_options& options) {
  return (options.flags & LSP_TRACE_APPROXIMATE) != 0 &&
         (scene.header->required_features & (LSP_FEATURE_LINE_SPACES | LSP_FEATURE_CELLS)) != 0;
}

// Refuses a scene that lacks what the options need: LSP_ERROR_UNSUPPORTED and *error.
lsp_status check_scene(const lsp_scene& scene, const lsp_trace_options& options, lsp_error* error);

}  // namespace lsp
