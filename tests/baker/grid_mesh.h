// A mesh for programs to bake.
#pragma once

#include <sstream>
#include <string>

namespace lsp::test {

// Little bumps.
inline double bumps(int i, int j) { return (i * 7 + j * 13) % 5; }

// A grid of size x size quads as .obj, y up, of these heights.
inline std::string grid_obj(int size, double (*height)(int, int) = bumps) {
  std::ostringstream obj;
  for (int i = 0; i <= size; ++i)
    for (int j = 0; j <= size; ++j) obj << "v " << i << " " << height(i, j) << " " << j << "\n";
  for (int i = 0; i < size; ++i)
    for (int j = 0; j < size; ++j) {
      const int a = i * (size + 1) + j + 1;
      obj << "f " << a << " " << a + 1 << " " << a + size + 2 << " " << a + size + 1 << "\n";
    }
  return obj.str();
}

}  // namespace lsp::test
