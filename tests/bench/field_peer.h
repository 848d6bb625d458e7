// A distance field of the scene beside cells of the same size.
#pragma once

#include "context.h"

namespace lsp::bench {

Table field_table();

// Adds the scene's rows: the field at the threshold that errs least, and `lsp-bake --base cells --no-exact
// --max-size` of the field's bytes, where a bake is as small as that. Of a scene given as .lsp the field
// alone.
void measure_field(Context& context, SceneUnderTest& scene, Section& section, Table& table);

}  // namespace lsp::bench
