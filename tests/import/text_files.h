// Small files in formats of text and of plain records.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "mesh_files.h"

namespace lsp_test {

// Corners of a square, as .obj has them.
inline const std::string kSquare = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

// The same mesh in each of PLY's three encodings, with properties before, between and behind the used ones.
inline std::string ply(const std::string& format, const std::string& body) {
  return "ply\nformat " + format +
         " 1.0\ncomment x\nelement vertex 4\nproperty uchar red\nproperty double x\nproperty float y\n"
         "property short z\nproperty list uchar float weights\nelement other 1\nproperty int k\n"
         "element face 2\nproperty uchar flag\nproperty list uchar int vertex_indices\nproperty float "
         "quality\nend_header\n" +
         body;
}

template <typename T>
void append_ordered(std::string& out, T value, bool big) {
  std::string raw;
  append(raw, value);
  if (big) std::reverse(raw.begin(), raw.end());
  out += raw;
}

inline std::string binary_ply(bool big) {
  std::string body;
  for (const glm::ivec3 p :
       {glm::ivec3(0, 0, 3), glm::ivec3(1, 0, 3), glm::ivec3(1, 1, 3), glm::ivec3(0, 1, 3)}) {
    append_ordered(body, uint8_t{9}, big);
    append_ordered(body, double(p.x), big);
    append_ordered(body, float(p.y), big);
    append_ordered(body, int16_t(p.z), big);
    append_ordered(body, uint8_t{2}, big);
    append_ordered(body, 0.5f, big);
    append_ordered(body, 0.5f, big);
  }
  append_ordered(body, int32_t{7}, big);
  for (const std::vector<int>& face : {std::vector<int>{0, 1, 2, 3}, {0, 1, 2}}) {
    append_ordered(body, uint8_t{1}, big);
    append_ordered(body, uint8_t(face.size()), big);
    for (const int index : face) append_ordered(body, int32_t(index), big);
    append_ordered(body, 0.25f, big);
  }
  return ply(big ? "binary_big_endian" : "binary_little_endian", body);
}

inline std::string binary_stl(const std::string& header, uint32_t declared, int triangles) {
  std::string out = header;
  out.resize(80, ' ');
  append(out, declared);
  for (int i = 0; i < triangles; ++i) {
    const float values[12] = {0, 0, 2, 0, 0, float(i), 1, 0, float(i), 0, 1, float(i)};
    append(out, values);
    append(out, uint16_t{0});
  }
  return out;
}

}  // namespace lsp_test
