#include "import/picture.h"

#include <webp/decode.h>

#include <cstdlib>
#include <memory>

namespace {

// What stb_image may still allocate for one picture: a few bytes of compressed zeros unfold to anything.
thread_local uint64_t bytes_left = 0;

void* bounded_malloc(size_t size) {
  if (size > bytes_left) return nullptr;
  bytes_left -= size;
  return std::malloc(size);
}

void* bounded_realloc(void* old, size_t size) {
  if (size > bytes_left) return nullptr;
  bytes_left -= size;
  return std::realloc(old, size);
}

}  // namespace

#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_ONLY_TGA
#define STBI_ONLY_BMP
#define STBI_NO_STDIO
#define STBI_NO_FAILURE_STRINGS
#define STBI_MALLOC(size) bounded_malloc(size)
#define STBI_REALLOC(old, size) bounded_realloc(old, size)
#define STBI_FREE(old) std::free(old)
#include <stb/stb_image.h>

namespace lsp {
namespace {

struct Free {
  void operator()(void* bytes) const { std::free(bytes); }
};

Picture decode_webp(const std::string& file, std::string_view bytes, Budget& budget, std::string& why) {
  const auto* data = reinterpret_cast<const uint8_t*>(bytes.data());
  int width = 0, height = 0;
  Picture picture;
  why = "is damaged WebP";
  if (!WebPGetInfo(data, bytes.size(), &width, &height) || width <= 0 || height <= 0) return picture;
  budget.charge(file, uint64_t(width) * uint64_t(height), 8);
  picture.rgba.resize(size_t(width) * size_t(height) * 4);
  if (!WebPDecodeRGBAInto(data, bytes.size(), picture.rgba.data(), picture.rgba.size(), width * 4)) return {};
  picture.width = uint32_t(width);
  picture.height = uint32_t(height);
  return picture;
}

Picture decode_stb(const std::string& file, std::string_view bytes, Budget& budget, std::string& why) {
  const auto* data = reinterpret_cast<const stbi_uc*>(bytes.data());
  int width = 0, height = 0, channels = 0;
  bytes_left = uint64_t{1} << 20;
  why = "is of no format known here, or damaged";
  if (bytes.size() > 0x7FFFFFFF ||
      !stbi_info_from_memory(data, int(bytes.size()), &width, &height, &channels))
    return {};
  const uint64_t texels = uint64_t(width) * uint64_t(height);
  budget.charge(file, texels, 16);
  // Rows as they are, unfolded (twice while they grow), in 16 bits, and as four components.
  bytes_left = (uint64_t{1} << 20) + texels * 48;
  why = "is damaged";
  Picture picture;
  if (stbi_is_16_bit_from_memory(data, int(bytes.size()))) {
    const std::unique_ptr<stbi_us, Free> wide(
        stbi_load_16_from_memory(data, int(bytes.size()), &width, &height, &channels, 4));
    if (!wide) return {};
    picture.rgba.resize(texels * 4);
    for (size_t i = 0; i < picture.rgba.size(); ++i)
      picture.rgba[i] = uint8_t((uint32_t{wide.get()[i]} * 255 + 32767) / 65535);
  } else {
    const std::unique_ptr<stbi_uc, Free> texel_bytes(
        stbi_load_from_memory(data, int(bytes.size()), &width, &height, &channels, 4));
    if (!texel_bytes) return {};
    picture.rgba.assign(texel_bytes.get(), texel_bytes.get() + texels * 4);
  }
  picture.width = uint32_t(width);
  picture.height = uint32_t(height);
  return picture;
}

}  // namespace

Picture decode_picture(const std::string& file, std::string_view bytes, Budget& budget, std::string& why) {
  if (bytes.substr(0, 7) == "\xABKTX 20") {
    why = "is KTX2, which is not read";
    return {};
  }
  const bool webp = bytes.substr(0, 4) == "RIFF" && bytes.size() > 12 && bytes.substr(8, 4) == "WEBP";
  Picture picture = webp ? decode_webp(file, bytes, budget, why) : decode_stb(file, bytes, budget, why);
  for (size_t i = 3; i < picture.rgba.size() && !picture.has_alpha; i += 4)
    picture.has_alpha = picture.rgba[i] != 255;
  return picture;
}

}  // namespace lsp
