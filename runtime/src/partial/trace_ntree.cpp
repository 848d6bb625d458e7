// Of scenes with LSP_FEATURE_COVERAGE: the text of the others with every part.
#define LSP_VARIANT partial

#include "../trace_ntree.cpp"

void lsp::partial::trace_far_in_ntree(const lsp_scene& scene, uint32_t flags, float lod, const LspRay& ray,
                                      LspHit& hit, lsp_trace_counts* counts) {
  NTreeTraversal traversal;
  const auto traced =
      traversal.lsp_trace_ready(scene, NTreeTraversal::lsp_setup(scene, ray), {flags, lod, true, 0}, ray);
  hit = traced.hit;
  add(counts, traced);
}
