// Materials of OBJ files.
#pragma once

#include <filesystem>
#include <map>
#include <set>
#include <string>

#include "import/budget.h"
#include "mesh.h"

namespace lsp {

// A texture as a .mtl file names it, with the options that are read.
struct MtlMap {
  std::string file;  // empty: none
  glm::dvec2 scale{1}, offset{0};
  double base = 0, gain = 1;  // of -mm: a stored value v, of 0 to 1, stands for base + gain v
  bool clamp = false;
  char channel = 0;  // of map_d: r, g, b, m, l or z where the file says so
};

struct MtlMaterial {
  Material material;
  MtlMap color, emission, opacity;  // map_Kd, map_Ke, map_d
  std::filesystem::path folder;     // of the .mtl file
};

// Reads the materials of a .mtl file into `materials` by name; the first definition of a name counts. Kd and
// Ke are taken as linear, and as 1 where only their map is given, or a factor of 0 beside it; d wins over Tr;
// Pr and Pm (the physically based extension) win over a roughness derived from Ns. What is passed over is
// added to `notes`. Hostile input is fine: what is not understood is skipped. Throws Failure kFile where it
// cannot be read.
void read_mtl(const std::filesystem::path& path, Budget& budget,
              std::map<std::string, MtlMaterial>& materials, std::set<std::string>& notes);

}  // namespace lsp
