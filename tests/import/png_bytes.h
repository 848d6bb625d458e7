// Small PNG files for the tests.
#pragma once

#include <png.h>

#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

namespace lsp_test {

// `format` as libpng's simplified interface calls it; `values` row after row, 8 or 16 bits by the format.
template <typename T>
std::string png_bytes(uint32_t width, uint32_t height, png_uint_32 format, const std::vector<T>& values,
                      const std::vector<uint8_t>& palette = {}) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = width;
  image.height = height;
  image.format = format;
  image.colormap_entries = png_uint_32(palette.size() / 3);
  std::string bytes(65536 + values.size() * 4, '\0');
  png_alloc_size_t size = bytes.size();
  const void* colors = palette.empty() ? nullptr : palette.data();
  if (!png_image_write_to_memory(&image, bytes.data(), &size, 0, values.data(), 0, colors))
    throw std::runtime_error(image.message);
  bytes.resize(size);
  return bytes;
}

inline std::string rgba_png(uint32_t width, uint32_t height, const std::vector<uint8_t>& values) {
  return png_bytes(width, height, PNG_FORMAT_RGBA, values);
}

}  // namespace lsp_test
