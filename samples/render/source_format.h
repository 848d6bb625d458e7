// What the baked meshes were files of, which says more of their axes than the meshes do.
#pragma once

#include <set>
#include <string>

#include "lsp/lsp.h"

namespace lsp::sample {

// The endings of the files that `scene` was baked from, in lower case, such as ".gltf"; of the meshes, not of
// what lies beside them. Empty where META does not say. META may be hostile.
std::set<std::string> source_endings(const lsp_scene& scene);

}  // namespace lsp::sample
