// What the lines through a cell meet first and last.
//
// Triangles stand side by side in blocks, each with the box of what it holds of the cell: a block costs a
// line that passes its box little, and one that enters it the same for all of its triangles together.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "box.h"
#include "lsp/layout.h"

namespace lsp {

// Answers do not depend on the order of the triangles or on the instruction set: of equal hits that of the
// smallest number counts. Edges are watertight in the sense that a line through one hits one of its
// triangles: edge functions are triple products, whose sign is the same, seen from either side.
class CellLines {
 public:
  static constexpr size_t kMost = 16;       // lines that are cast at once
  static constexpr size_t kTriangles = 16;  // of a block
  static constexpr float kMiss = 1.0f;

  // By line: where it meets something, in shares of the way, and the number of what it meets.
  struct Hits {
    std::array<float, kMost> t;
    std::array<uint32_t, kMost> triangle;
  };

  // The cell is the cube `box`; what comes within `margin` of it counts. World space. A triangle is named by
  // its place in `records`, which best are in an order in which neighbours are near to each other.
  CellLines(std::span<const LspTriangle> triangles, std::span<const uint32_t> records, const Box& box,
            float margin);

  // The lines that are cast from now on go from `from`, a rectangle of one side, to `face`, another side.
  void aim(const Box& from, uint32_t face);

  // Casts the lines from `origin` to `ends`, at most kMost points of the face that is aimed at. `first` is
  // what a line meets first, kMiss and LSP_NONE where it meets nothing, and `last` what it meets last, 0 and
  // LSP_NONE: the first of the same line the other way round.
  void cast(const glm::vec3& origin, std::span<const glm::vec3> ends, Hits& first, Hits& last) const;

  // By triangle of a block.
  using Lane = std::array<float, kTriangles>;
  struct Block {
    std::array<Lane, 9> corners;  // v0.x, v0.y, v0.z, v1.x, ...
    std::array<Lane, 3> normal;   // of any length
    std::array<uint32_t, kTriangles> number;
    Box box;
  };
  // Of as many blocks.
  struct Boxes {
    std::array<Lane, 3> lo{}, hi{};
  };

 private:
  void add_aimed(const Block& block);

  Box box_;
  std::vector<Block> blocks_;
  uint32_t face_ = 0;
  std::vector<const Block*> aimed_;  // the blocks that some line may enter
  std::vector<Boxes> boxes_;         // of these
};

}  // namespace lsp
