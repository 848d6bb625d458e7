// lsp-bake --instances: a scene of several .lsp files.
#pragma once

#include "arguments.h"
#include "lsp/command_line.h"

namespace lsp {

// Bakes each distinct mesh of the inputs once, to NAME.MESH.lsp beside a.output (NAME.json), and writes that:
// the scene with an instance for every place of a mesh. All files get their names in the end, the scene last.
// Prints the report. Throws Failure.
void bake_scene(const Arguments& a, ProgressBar& bar);

}  // namespace lsp
