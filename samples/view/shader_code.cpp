#include "shader_code.h"

#include "lsp/layout.h"

namespace lsp::sample {
namespace {

constexpr uint32_t kEye[] =
#include "view_eye.spv.inc"
    ;
constexpr uint32_t kEyeNtree[] =
#include "view_eye_ntree.spv.inc"
    ;
constexpr uint32_t kEyeWide[] =
#include "view_eye_wide.spv.inc"
    ;
constexpr uint32_t kEyeInstances[] =
#include "view_eye_instances.spv.inc"
    ;
constexpr uint32_t kGather[] =
#include "view_gather.spv.inc"
    ;
constexpr uint32_t kGatherNtree[] =
#include "view_gather_ntree.spv.inc"
    ;
constexpr uint32_t kGatherCells[] =
#include "view_gather_cells.spv.inc"
    ;
constexpr uint32_t kGatherWide[] =
#include "view_gather_wide.spv.inc"
    ;
constexpr uint32_t kGatherInstances[] =
#include "view_gather_instances.spv.inc"
    ;
constexpr uint32_t kLight[] =
#include "view_light.spv.inc"
    ;
constexpr uint32_t kLightNtree[] =
#include "view_light_ntree.spv.inc"
    ;
constexpr uint32_t kLightCells[] =
#include "view_light_cells.spv.inc"
    ;
constexpr uint32_t kLightWide[] =
#include "view_light_wide.spv.inc"
    ;
constexpr uint32_t kLightInstances[] =
#include "view_light_instances.spv.inc"
    ;
constexpr uint32_t kShow[] =
#include "view_show.spv.inc"
    ;

}  // namespace

// What the eye sees is traced exactly, which cells do not do.
std::span<const uint32_t> eye_code(uint32_t base_structure) {
  if (base_structure == LSP_BASE_NTREE) return kEyeNtree;
  if (base_structure == LSP_BASE_WIDE) return kEyeWide;
  if (base_structure == kInstancesShader) return kEyeInstances;
  return kEye;
}

std::span<const uint32_t> gather_code(uint32_t base_structure) {
  if (base_structure == LSP_BASE_NTREE) return kGatherNtree;
  if (base_structure == LSP_BASE_CELLS) return kGatherCells;
  if (base_structure == LSP_BASE_WIDE) return kGatherWide;
  if (base_structure == kInstancesShader) return kGatherInstances;
  return kGather;
}

std::span<const uint32_t> light_code(uint32_t base_structure) {
  if (base_structure == LSP_BASE_NTREE) return kLightNtree;
  if (base_structure == LSP_BASE_CELLS) return kLightCells;
  if (base_structure == LSP_BASE_WIDE) return kLightWide;
  if (base_structure == kInstancesShader) return kLightInstances;
  return kLight;
}

std::span<const uint32_t> show_code() { return kShow; }

}  // namespace lsp::sample
