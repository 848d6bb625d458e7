// Joins the parts of a bake into what one bake makes.
#pragma once

#include <vector>

#include "shard/part.h"

namespace lsp {

// Orders parts by their numbers. Throws Failure with Exit::kUsage where they are not each of I/K once, with
// Exit::kInvalid where they are of different bakes.
void check_parts(std::vector<Part>& parts);

// The bake of these parts, as bake() has it but for what finishes it. What parts say may be hostile: all that
// tracing follows is checked. Throws Failure with Exit::kInvalid.
Baked join_parts(const std::vector<Part>& parts);

}  // namespace lsp
