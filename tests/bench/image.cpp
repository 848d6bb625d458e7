#include "image.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <sstream>

#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STBI_WRITE_NO_STDIO
#include <stb/stb_image_write.h>

#include "lsp/program.h"
#include "same_size.h"

namespace lsp::bench {

Image read_pfm(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw Failure(Exit::kFile, path, "cannot be read");
  std::string magic;
  uint32_t width = 0, height = 0;
  float scale = 0;
  file >> magic >> width >> height >> scale;
  file.get();
  const size_t channels = magic == "PF" ? 3 : magic == "Pf" ? 1 : 0;
  if (!file || channels == 0 || width == 0 || height == 0 || width > 65536 || height > 65536 || scale == 0) {
    throw Failure(Exit::kInvalid, path, "is no .pfm picture");
  }
  Image image(width, height);
  std::vector<float> row(width * channels);
  for (uint32_t y = height; y-- > 0;) {  // rows from the bottom
    file.read(reinterpret_cast<char*>(row.data()), static_cast<std::streamsize>(row.size() * sizeof(float)));
    if (!file) throw Failure(Exit::kInvalid, path, "ends early");
    for (uint32_t x = 0; x < width; ++x) {
      for (size_t c = 0; c < 3; ++c) {
        auto bits = std::bit_cast<uint32_t>(row[x * channels + (channels == 3 ? c : 0)]);
        if (scale > 0) bits = __builtin_bswap32(bits);  // a positive scale means big-endian
        image.at(x, y)[static_cast<int>(c)] = std::bit_cast<float>(bits);
      }
    }
  }
  return image;
}

namespace {

std::vector<uint8_t> bytes_of(const Image& image) {
  std::vector<uint8_t> bytes;
  bytes.reserve(image.pixels.size() * 3);
  for (const glm::vec3& pixel : image.pixels) {
    for (int c = 0; c < 3; ++c) {
      const float value = std::clamp(pixel[c], 0.0f, 1.0f);
      bytes.push_back(static_cast<uint8_t>(std::lround(value * 255.0f)));
    }
  }
  return bytes;
}

void append(void* out, void* data, int size) {
  static_cast<std::string*>(out)->append(static_cast<const char*>(data), static_cast<size_t>(size));
}

}  // namespace

std::string encode_png(const Image& image) {
  std::string png;
  stbi_write_png_to_func(append, &png, static_cast<int>(image.width), static_cast<int>(image.height), 3,
                         bytes_of(image).data(), static_cast<int>(image.width * 3));
  return png;
}

std::string encode_jpeg(const Image& image, int quality) {
  std::string jpeg;
  stbi_write_jpg_to_func(append, &jpeg, static_cast<int>(image.width), static_cast<int>(image.height), 3,
                         bytes_of(image).data(), quality);
  return jpeg;
}

Image crop(const Image& image, uint32_t x, uint32_t y, uint32_t width, uint32_t height) {
  Image part(width, height);
  for (uint32_t j = 0; j < height; ++j) {
    for (uint32_t i = 0; i < width; ++i) part.at(i, j) = image.at(x + i, y + j);
  }
  return part;
}

void draw_frame(Image& image, uint32_t x, uint32_t y, uint32_t width, uint32_t height, glm::vec3 colour) {
  constexpr uint32_t kWide = 2;
  const uint32_t x0 = x - std::min(x, kWide), y0 = y - std::min(y, kWide);
  const uint32_t x1 = std::min(x + width + kWide, image.width),
                 y1 = std::min(y + height + kWide, image.height);
  for (uint32_t j = y0; j < y1; ++j) {
    for (uint32_t i = x0; i < x1; ++i) {
      const bool inside = i >= x && i < x + width && j >= y && j < y + height;
      if (!inside) image.at(i, j) = colour;
    }
  }
}

Image to_display(const Image& linear, float exposure) {
  Image image = linear;
  for (glm::vec3& pixel : image.pixels) {
    for (int c = 0; c < 3; ++c) {
      const float x = std::clamp(pixel[c] * exposure, 0.0f, 1.0f);
      pixel[c] = x <= 0.0031308f ? 12.92f * x : 1.055f * std::pow(x, 1 / 2.4f) - 0.055f;
    }
  }
  return image;
}

double ssim(const Image& reference, const Image& image) {
  require_same_size(reference, image);
  constexpr int kRadius = 5;
  constexpr double kSigma = 1.5, kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;
  const int width = static_cast<int>(image.width), height = static_cast<int>(image.height);
  if (width <= 2 * kRadius || height <= 2 * kRadius) {
    throw Failure(Exit::kInvalid, "", "pictures under 11 x 11 pixels have no structural similarity");
  }
  double weights[2 * kRadius + 1], total = 0;
  for (int k = -kRadius; k <= kRadius; ++k) {
    total += weights[k + kRadius] = std::exp(-k * k / (2 * kSigma * kSigma));
  }
  for (double& weight : weights) weight /= total;

  // The five moments x, y, xx, yy, xy, blurred along rows, then along columns.
  using Moments = std::array<double, 5>;
  const auto luma = [](const glm::vec3& p) { return 0.2126 * p.r + 0.7152 * p.g + 0.0722 * p.b; };
  const int columns = width - 2 * kRadius;
  std::vector<Moments> rows(static_cast<size_t>(columns) * static_cast<size_t>(height));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < columns; ++x) {
      Moments sum{};
      for (int k = 0; k <= 2 * kRadius; ++k) {
        const double a = luma(reference.at(static_cast<uint32_t>(x + k), static_cast<uint32_t>(y)));
        const double b = luma(image.at(static_cast<uint32_t>(x + k), static_cast<uint32_t>(y)));
        const Moments moments{a, b, a * a, b * b, a * b};
        for (size_t m = 0; m < 5; ++m) sum[m] += weights[k] * moments[m];
      }
      rows[static_cast<size_t>(y * columns + x)] = sum;
    }
  }
  double similarity = 0;
  for (int y = 0; y < height - 2 * kRadius; ++y) {
    for (int x = 0; x < columns; ++x) {
      Moments m{};
      for (int k = 0; k <= 2 * kRadius; ++k) {
        for (size_t i = 0; i < 5; ++i)
          m[i] += weights[k] * rows[static_cast<size_t>((y + k) * columns + x)][i];
      }
      const double var_a = m[2] - m[0] * m[0], var_b = m[3] - m[1] * m[1], cov = m[4] - m[0] * m[1];
      similarity += (2 * m[0] * m[1] + kC1) * (2 * cov + kC2) /
                    ((m[0] * m[0] + m[1] * m[1] + kC1) * (var_a + var_b + kC2));
    }
  }
  return similarity / (static_cast<double>(columns) * (height - 2 * kRadius));
}

}  // namespace lsp::bench
