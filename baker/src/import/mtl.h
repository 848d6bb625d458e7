// Materials of OBJ files.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "import/budget.h"
#include "mesh.h"

namespace lsp {

// Reads the materials of a .mtl file into `materials` by name; the first definition of a name counts. Kd is
// taken as linear; Pr and Pm (the physically based extension) win over a roughness derived from Ns.
// Hostile input is fine: what is not understood is skipped. Throws Failure kFile where it cannot be read.
void read_mtl(const std::filesystem::path& path, Budget& budget, std::map<std::string, Material>& materials);

}  // namespace lsp
