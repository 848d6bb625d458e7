// Pictures in floats, and how different two of them are.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <string>
#include <vector>

namespace lsp::bench {

struct Image {
  uint32_t width = 0, height = 0;
  std::vector<glm::vec3> pixels;  // linear light, rows from the top

  Image() = default;
  Image(uint32_t w, uint32_t h, glm::vec3 fill = glm::vec3(0))
      : width(w), height(h), pixels(size_t{w} * h, fill) {}
  glm::vec3& at(uint32_t x, uint32_t y) { return pixels[size_t{y} * width + x]; }
  const glm::vec3& at(uint32_t x, uint32_t y) const { return pixels[size_t{y} * width + x]; }
};

// Reads a colour or grey .pfm. Throws Failure(kFile or kInvalid).
Image read_pfm(const std::string& path);

// 8-bit PNG in memory; `image` holds display values in [0, 1] already.
std::string encode_png(const Image& image);

std::string encode_jpeg(const Image& image, int quality = 88);

// The part of `image` that begins at x, y; it must lie inside.
Image crop(const Image& image, uint32_t x, uint32_t y, uint32_t width, uint32_t height);

// A frame two pixels wide around that part, drawn into `image`.
void draw_frame(Image& image, uint32_t x, uint32_t y, uint32_t width, uint32_t height, glm::vec3 colour);

// Linear to sRGB, clamped to [0, 1].
Image to_display(const Image& linear, float exposure = 1);

// All comparisons want two images of one size; throw Failure(kInvalid) otherwise.

// Mean structural similarity of the luma (Rec. 709 weights) of display values: Wang, Bovik, Sheikh,
// Simoncelli, "Image Quality Assessment", 2004; Gaussian window of 11, sigma 1.5, where it fits. 1: equal.
double ssim(const Image& reference, const Image& image);

// Perceptual difference of display values (sRGB in [0, 1]) seen at `pixels_per_degree`, per pixel in [0, 1]:
// Andersson, Nilsson, Akenine-Moeller, Oskarsson, Astrom, Fairchild, "FLIP: A Difference Evaluator for
// Alternating Images", HPG 2020. The usual figure is the mean; 67 is a 0.7 m wide 4K monitor at 0.7 m.
std::vector<float> flip_map(const Image& reference, const Image& image, double pixels_per_degree = 67);
double flip(const Image& reference, const Image& image, double pixels_per_degree = 67);

}  // namespace lsp::bench
