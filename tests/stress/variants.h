// The tracer compiled with a fault in it, one namespace a fault, and once without (`sound`). See
// mutants.cmake.
#pragma once

#include "checks.h"

#define LSP_DECLARE_VARIANT(name)                                                                            \
  namespace lsp::stress::name {                                                                              \
  void trace(const lsp_scene& scene, uint32_t flags, const LspRay* rays, LspHit* hits, uint64_t count);      \
  /* False: an invalid ray, or one that misses the box. */                                                   \
  bool shaft(const lsp_scene& scene, const LspRay& ray, uint32_t line_space, uint32_t* out);                 \
  /* One triangle record alone; t in lengths of the direction scaled to [1, 2). */                           \
  bool triangle(const lsp_scene& scene, const LspRay& ray, uint32_t record, float* t);                       \
  /* One box alone. */                                                                                       \
  bool box(const lsp_scene& scene, const LspRay& ray, const lsp_float3& lo, const lsp_float3& hi, float* t); \
  }

LSP_DECLARE_VARIANT(sound)
#define LSP_VARIANT(name) LSP_DECLARE_VARIANT(name)
#include "variants.inc"
#undef LSP_VARIANT
