// What lsp-bake decides by itself: the settings behind a preset, those that keep an error, and what is left
// out.
#pragma once

#include "arguments.h"
#include "error.h"

namespace lsp {

// Sets by the preset what was not given. Throws Failure with Exit::kUsage where options contradict each
// other.
void settle(Arguments& a);

struct Chosen {
  Baked baked;
  MeasuredError error;
};

// Bakes by the settings of `a`, which settle() has completed; with --max-error by the cheapest that err no
// more, which `a` then states. Measures the error, then leaves out what --no-exact gives up. Throws Failure
// with Exit::kLimit where no setting is accurate enough.
Chosen bake_as_asked(const Mesh& mesh, Arguments& a, const Progress& progress);

}  // namespace lsp
