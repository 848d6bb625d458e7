// What lsp-bake does with --shard: bakes one shard of the cells and writes it as a part.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "arguments.h"
#include "writer.h"

namespace lsp {

// What has been made of the input.
struct ShardInput {
  const Mesh& mesh;
  const std::vector<std::string>& material_names;
  std::array<uint64_t, 2> source;  // its hash
  double import_seconds;
};

// Bakes a.shard, writes it to a.output and reports, as `a` asks. `write` is of the file that a merge will
// write.
void write_shard(const Arguments& a, const ShardInput& input, const WriteOptions& write,
                 const Progress& progress);

}  // namespace lsp
