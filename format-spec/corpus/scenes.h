// The valid files of the corpus: small scenes that use every feature of the format.
#pragma once

#include <string>
#include <vector>

#include "image.h"

namespace lsp::corpus {

struct SceneOptions {
  uint32_t leaf_triangles = 2;
  uint32_t resolution = 0;             // 0: no Line Spaces
  std::vector<uint32_t> depths = {1};  // nodes at these depths carry one; 0 is the root
  uint32_t entry_bytes = 1;            // 0 makes binary, symmetric Line Spaces
  bool dense = false;
  bool directed = false;  // of binary ones: a bit a direction
  bool normals = false;
  bool materials = false;
  bool exact = true;  // false: subtrees below terminal Line Spaces are left out
};

// A box on a floor: 14 triangles, 2 materials.
std::vector<LspTriangle> box_on_floor_triangles();
Image box_on_floor(const SceneOptions& options);

// The scene that mutations start from: all features, Line Spaces of N = 1 on two levels.
Image full_scene();

// The scene with the gaps that its materials' opacity says.
Image partial(Image image);

struct ValidFile {
  std::string name;   // without ".lsp"
  std::string shows;  // one sentence
  Bytes bytes;
};
std::vector<ValidFile> valid_files();

}  // namespace lsp::corpus
