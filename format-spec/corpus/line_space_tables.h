// The Line Spaces of the corpus: every shaft is sampled by the ray between its patches' centres.
#pragma once

#include <cstdint>
#include <vector>

#include "image.h"

namespace lsp::corpus {

struct Box {
  lsp_float3 lo, hi;
  static Box nothing();
  void add(const lsp_float3& p);
};

struct LineSpaceOptions {
  uint32_t resolution = 0;   // N; 0: no Line Spaces
  uint32_t entry_bytes = 1;  // 0 makes them binary and symmetric
  bool dense = false;
  bool directed = false;  // binary, but each direction of a shaft has a bit of its own
};

class LineSpaceTables {
 public:
  explicit LineSpaceTables(const LineSpaceOptions& options) : options_(options) {}

  // Computes Line Space `index` of the image, that of a node with this box and child reference, whose
  // triangles lie in the image already. Its words and candidates are kept apart until all are known, because
  // a Line Space precedes those below it.
  void fill(Image& image, uint32_t index, uint32_t child, const Box& box, uint32_t triangle_first,
            uint32_t triangle_count);

  // Adds the words and candidates of all Line Spaces to the image, in their order.
  void pack(Image& image) const;

 private:
  LineSpaceOptions options_;
  std::vector<std::vector<uint32_t>> tables_;  // per Line Space: the entry of every shaft
};

// A triangle's normals and SMOOTH flag, and two materials; what does not depend on the tree's shape.
void add_normals(Image& image);
void add_materials(Image& image);

}  // namespace lsp::corpus
