#include "picture.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <sstream>

#include "lsp/file_ending.h"
#include "lsp/output_file.h"
#include "lsp/program.h"

#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#include <stb/stb_image_write.h>
#pragma GCC diagnostic pop

namespace lsp::sample {
namespace {

static_assert(std::endian::native == std::endian::little, ".pfm is written little-endian");

uint8_t to_srgb(float linear) {
  const float x = linear > 0.0f ? std::min(linear, 1.0f) : 0.0f;  // NaN becomes black
  const float encoded = x <= 0.0031308f ? 12.92f * x : 1.055f * std::pow(x, 1.0f / 2.4f) - 0.055f;
  return static_cast<uint8_t>(encoded * 255.0f + 0.5f);
}

std::string png(int width, int height, int channels, const std::vector<uint8_t>& bytes) {
  std::string out;
  const auto append = [](void* context, void* data, int size) {
    static_cast<std::string*>(context)->append(static_cast<const char*>(data), static_cast<size_t>(size));
  };
  stbi_write_png_to_func(append, &out, width, height, channels, bytes.data(), channels * width);
  return out;
}

std::string to_png(const Picture& picture, Transfer transfer) {
  std::vector<uint8_t> bytes;
  bytes.reserve(picture.pixels.size() * 3);
  for (const glm::vec3& pixel : picture.pixels) {
    const glm::vec3 shown = transfer == Transfer::kToneMapped ? tone_map(pixel) : pixel;
    for (int i = 0; i < 3; ++i) bytes.push_back(to_srgb(shown[i]));
  }
  return png(picture.width, picture.height, 3, bytes);
}

std::string to_pfm(const Picture& picture) {
  std::string out =
      "PF\n" + std::to_string(picture.width) + " " + std::to_string(picture.height) + "\n-1.0\n";
  // Rows run from the bottom up.
  for (int y = picture.height - 1; y >= 0; --y) {
    const glm::vec3* row =
        picture.pixels.data() + static_cast<size_t>(y) * static_cast<size_t>(picture.width);
    out.append(reinterpret_cast<const char*>(row), static_cast<size_t>(picture.width) * sizeof(glm::vec3));
  }
  return out;
}

}  // namespace

glm::vec3 tone_map(glm::vec3 radiance) {
  const glm::vec3 x = glm::max(radiance, glm::vec3(0.0f)) * 0.6f;
  return glm::clamp(x * (2.51f * x + 0.03f) / (x * (2.43f * x + 0.59f) + 0.14f), 0.0f, 1.0f);
}

void check_picture_name(const std::filesystem::path& path) {
  const std::string ending = file_ending(path);
  if (ending != ".png" && ending != ".pfm")
    throw Failure(Exit::kUsage, path.string(), "pictures are written as .png or .pfm; choose one of the two");
}

void write_picture(const std::filesystem::path& path, const Picture& picture, Transfer transfer) {
  check_picture_name(path);
  write_file(path, file_ending(path) == ".pfm" ? to_pfm(picture) : to_png(picture, transfer));
}

std::string rgba_png(int width, int height, const std::vector<uint8_t>& rgba) {
  return png(width, height, 4, rgba);
}

Picture read_pfm(const std::filesystem::path& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error))
    throw Failure(Exit::kFile, path.string(), "is a folder; give the name of a .pfm picture");
  std::ifstream file(path, std::ios::binary);
  if (!file) throw Failure(Exit::kFile, path.string(), "cannot be opened; check the path");
  std::string magic;
  int64_t width = 0;
  int64_t height = 0;
  float scale = 0;
  file >> magic >> width >> height >> scale;
  file.get();  // the one white space before the data
  const std::streamoff head = file.tellg();
  constexpr int64_t kLargest = 1 << 15;
  if (!file || magic != "PF" || width < 1 || height < 1 || width > kLargest || height > kLargest ||
      !std::isfinite(scale) || scale == 0) {
    throw Failure(Exit::kInvalid, path.string(),
                  "is not a colour .pfm picture; write one with lsp-render -o NAME.pfm");
  }
  const uint64_t size = std::filesystem::file_size(path, error);
  const uint64_t bytes = static_cast<uint64_t>(width) * static_cast<uint64_t>(height) * sizeof(glm::vec3);
  if (error || size < bytes) throw Failure(Exit::kInvalid, path.string(), "ends early; write it again");
  if (const uint64_t whole = static_cast<uint64_t>(head) + bytes; size > whole)
    throw Failure(Exit::kInvalid, path.string(),
                  "has " + std::to_string(size - whole) + " bytes more than its " + std::to_string(width) +
                      " x " + std::to_string(height) + " pixels; write it again");

  Picture picture(static_cast<int>(width), static_cast<int>(height));
  for (int64_t y = height - 1; y >= 0; --y) {
    file.read(reinterpret_cast<char*>(picture.pixels.data() + y * width),
              static_cast<std::streamsize>(static_cast<size_t>(width) * sizeof(glm::vec3)));
  }
  if (!file) throw Failure(Exit::kInvalid, path.string(), "ends early; write it again");
  if (scale > 0) {  // big-endian
    for (glm::vec3& pixel : picture.pixels) {
      for (int i = 0; i < 3; ++i) {
        pixel[i] = std::bit_cast<float>(__builtin_bswap32(std::bit_cast<uint32_t>(pixel[i])));
      }
    }
  }
  for (size_t i = 0; i < picture.pixels.size(); ++i) {
    const glm::vec3 pixel = picture.pixels[i];
    if (std::isfinite(pixel.x) && std::isfinite(pixel.y) && std::isfinite(pixel.z)) continue;
    const size_t row = i / static_cast<size_t>(width), column = i % static_cast<size_t>(width);
    throw Failure(Exit::kInvalid, path.string(),
                  "pixel " + std::to_string(column) + "," + std::to_string(row) +
                      " (from the upper left) is infinite or no number; render it again");
  }
  return picture;
}

}  // namespace lsp::sample
