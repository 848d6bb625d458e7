// The file's vectors as GLM's, and back.
#pragma once

#include <glm/glm.hpp>

#include "lsp/layout.h"

namespace lsp {

inline glm::vec3 vec(const lsp_float3& v) { return {v.x, v.y, v.z}; }
inline glm::dvec3 dvec(const lsp_float3& v) { return {v.x, v.y, v.z}; }
inline lsp_float3 f3(const glm::vec3& v) { return {v.x, v.y, v.z}; }
inline lsp_float3 f3(const glm::dvec3& v) { return {float(v.x), float(v.y), float(v.z)}; }

}  // namespace lsp
