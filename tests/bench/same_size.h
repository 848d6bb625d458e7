// The precondition of every comparison of two pictures.
#pragma once

#include "image.h"
#include "lsp/program.h"

namespace lsp::bench {

inline void require_same_size(const Image& a, const Image& b) {
  if (a.width != b.width || a.height != b.height || a.pixels.empty()) {
    throw Failure(Exit::kInvalid, "", "pictures of different sizes, or empty ones, cannot be compared");
  }
}

}  // namespace lsp::bench
