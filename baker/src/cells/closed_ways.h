// Which ways out of a cell lead nowhere out of the scene.
#pragma once

#include "../bake.h"

namespace lsp {

// Writes LspFilledCell.closed of every cell: the ways by which hardly a ray leaves the scene, of those that
// begin on what eyes within its box see. A ray that misses all the same is traced again, exactly: it costs
// time where this is wrong, never an answer. Needs exact data. The same with any number of threads.
void find_closed_ways(Baked& baked);

}  // namespace lsp
