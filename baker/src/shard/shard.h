// One of the equal shares that a bake is divided into.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace lsp {

// Number `number` of `count`, from 1 on. Every count-th item is its own, so that each shard has about as much
// of every region of the scene, cheap or dear.
struct Shard {
  uint32_t number = 1, count = 1;

  size_t share_of(size_t items) const { return (items + count - number) / count; }
  size_t item(size_t i) const { return i * count + number - 1; }
};

// Of "I/K". Throws Failure with Exit::kUsage.
Shard parse_shard(const std::string& text);

}  // namespace lsp
