#include "shader_code.h"

#include "lsp/layout.h"

namespace lsp::sample {
namespace {

#include "shaders.inc"

using Code = std::span<const uint32_t>;
// By kernel and base structure. What the eye sees is traced exactly, which cells do not do.
constexpr Code kCode[3][5] = {
    {view_eye_instances, view_eye, view_eye_ntree, {}, view_eye_wide},
    {view_gather_instances, view_gather, view_gather_ntree, view_gather_cells, view_gather_wide},
    {view_light_instances, view_light, view_light_ntree, view_light_cells, view_light_wide}};
static_assert(LSP_BASE_BVH == 1 && LSP_BASE_NTREE == 2 && LSP_BASE_CELLS == 3 && LSP_BASE_WIDE == 4);

}  // namespace

std::span<const uint32_t> shader_code(Kernel kernel, uint32_t base_structure) {
  return kernel == Kernel::kShow ? Code(view_show) : kCode[static_cast<size_t>(kernel)][base_structure];
}

}  // namespace lsp::sample
