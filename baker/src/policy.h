// What lsp-bake decides by itself: the settings behind a preset, those that keep an error, and what is left
// out.
#pragma once

#include <functional>

#include "accuracy.h"
#include "arguments.h"

namespace lsp {

// Sets by the preset what was not given. Throws Failure with Exit::kUsage where options contradict each
// other.
void settle(Arguments& a);

struct Chosen {
  Baked baked;
  MeasuredError error;
};

// What a bake of cells is asked to keep.
Accuracy accuracy_of(const Arguments& a);

// One shard of the cells, not finished: its dial and its error only the whole bake has.
Baked bake_shard(const Mesh& mesh, const Arguments& a, const Shard& shard, const Progress& progress);

// How long the file of a bake would be, in bytes.
using FileSize = std::function<uint64_t(Chosen&)>;

// Bakes by the settings of `a`, which settle() has completed; with --max-error by the cheapest that err no
// more, with --max-size by the finest grid of cells whose file is no longer, which `a` then states. Measures
// the error, then leaves out what --no-exact gives up. Throws Failure with Exit::kLimit where no setting is
// accurate or small enough.
Chosen bake_as_asked(const Mesh& mesh, Arguments& a, const Progress& progress, const FileSize& file_size);

}  // namespace lsp
