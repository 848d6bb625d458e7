// Shapes that are hard for grids and trees, each for a reason of its own.
#pragma once

#include "shapes.h"

namespace lsp::stress {

// Triangles that all meet in one corner, the tip of a cone of height and radius 1.
bench::Triangles fan(int count);

// Triangles that all share one edge, as the pages of a book.
bench::Triangles book(int count);

// A hedgehog: thin pyramids without a bottom, from a ball or, where `inner` is 0, from one point.
bench::Triangles hedgehog(int needles, float width, float inner);

// A sheet rolled up, of `turns` turns and 2 * `strips` triangles.
bench::Triangles spiral(int turns, int strips);

// Small boxes on one triangle that is `scale` times as large as the city.
bench::Triangles city(int blocks, float scale);

// Two corridors at a right angle, each `length` times as long as wide.
bench::Triangles long_corner(float length, int pieces);

}  // namespace lsp::stress
