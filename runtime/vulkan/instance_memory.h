// What a large batch of rays through instances works on.
#pragma once

#include <vector>

#include "../src/instance_batch.h"

namespace lsp {

// As InstanceArrays, of any size.
struct InstanceMemory {
  std::vector<InstanceWalk> walks;
  std::vector<uint32_t> on;
  std::vector<uint64_t> waiting;
  std::vector<LspRay> moved;
  std::vector<LspHit> found;

  size_t size() const { return walks.size(); }
  void grow(size_t count) {
    if (count <= size()) return;
    walks.resize(count);
    on.resize(count);
    waiting.resize(count);
    moved.resize(count);
    found.resize(count);
  }
};

}  // namespace lsp
