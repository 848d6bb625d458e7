// What the format word of a Line Space says about its tables.
#pragma once

#include <lsp/layout.h>

#include <cstdint>

namespace lsp::format {

struct LineSpaceShape {
  uint32_t resolution = 0;   // N
  uint32_t entry_bytes = 0;  // 0, 1, 2 or 4
  bool dense = false;
  bool symmetric = false;
  uint64_t shafts = 0;  // 30 N^4, or 15 N^4 when symmetric
  uint64_t words = 0;   // LspBitWord; none when dense

  // 32-bit words of CAND, given the number of filled shafts.
  uint64_t candidate_words(uint32_t filled) const {
    return ((dense ? shafts : filled) * entry_bytes + 3) / 4;
  }
};

// Any value of `format` gives a shape, sound or not: shafts stay below 2^37.
inline LineSpaceShape shape_of(uint32_t format) {
  LineSpaceShape shape;
  shape.resolution = format & LSP_FORMAT_RESOLUTION_MASK;
  shape.entry_bytes = format >> LSP_FORMAT_ENTRY_SHIFT & LSP_FORMAT_ENTRY_MASK;
  shape.dense = (format & LSP_FORMAT_DENSE) != 0;
  shape.symmetric = (format & LSP_FORMAT_SYMMETRIC) != 0;
  const uint64_t squared = uint64_t{shape.resolution} * shape.resolution;
  shape.shafts = (shape.symmetric ? 15 : 30) * squared * squared;
  shape.words = shape.dense ? 0 : (shape.shafts + 31) / 32;
  return shape;
}

}  // namespace lsp::format
