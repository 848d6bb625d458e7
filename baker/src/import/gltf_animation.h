// Animations of glTF documents: the pose of a scene at a time.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "import/gltf_accessor.h"
#include "import/mesh_builder.h"

namespace lsp {

// The pose asked for of all inputs together, and what came of it.
struct PoseRequest {
  std::optional<double> seconds;   // none: at rest
  std::string animation;           // by its name, else by its number from 0; empty: the first
  bool met = false;                // some input has the animation
  std::vector<std::string> known;  // the animations that inputs have, in words
};

// Moves the document's nodes, and gives them the morph weights, to where the request has them; notes what is
// not played. Throws Failure kInvalid where the animation is damaged.
void pose_document(GltfDocument& document, GltfAccessors& accessors, PoseRequest& request,
                   MeshBuilder& builder);

}  // namespace lsp
