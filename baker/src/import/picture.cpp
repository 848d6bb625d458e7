#include "import/picture.h"

#include <webp/decode.h>

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <utility>

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

// How many components a JPEG's frame has, and whether an Adobe marker says what they are.
struct JpegFrame {
  int components = 0;
  bool adobe = false;
};

JpegFrame jpeg_frame(std::string_view bytes) {
  JpegFrame frame;
  const auto byte = [&](size_t i) { return uint8_t(bytes[i]); };
  for (size_t at = 2; at + 10 <= bytes.size() && byte(at) == 0xFF;) {
    const uint8_t marker = byte(at + 1);
    if (marker == 0xFF) {  // a fill byte
      ++at;
      continue;
    }
    const bool is_frame =
        marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (marker == 0xEE && bytes.substr(at + 4, 5) == "Adobe") frame.adobe = true;
    if (is_frame) frame.components = byte(at + 9);
    if (is_frame || marker == 0xDA) break;
    at += 2 + size_t{byte(at + 2)} * 256 + byte(at + 3);
  }
  return frame;
}

// stb_image takes four components without Adobe's marker for luma and chroma; they are CMYK, and programs
// that show them take them to be as Adobe's.
std::string with_adobe_marker(std::string_view jpeg) {
  constexpr std::string_view kMarker(
      "\xFF\xEE\0\x0E"
      "Adobe\0\x64\0\0\0\0\0",
      16);
  return std::string(jpeg.substr(0, 2)).append(kMarker).append(jpeg.substr(2));
}

// Formats that people's exporters write and that are not read, by how they begin.
const char* foreign_format(std::string_view bytes) {
  constexpr std::pair<std::string_view, const char*> kFormats[] = {{"\xABKTX 20", "KTX2"},
                                                                   {"\xABKTX 11", "KTX"},
                                                                   {"DDS ", "DDS"},
                                                                   {"II*", "TIFF"},
                                                                   {"MM", "TIFF"},
                                                                   {"GIF8", "GIF"},
                                                                   {"8BPS", "a Photoshop document"},
                                                                   {"v/1\x01", "OpenEXR"},
                                                                   {"#?", "Radiance HDR"},
                                                                   {"\xFF\x0A", "JPEG XL"},
                                                                   {"<s", "SVG"},
                                                                   {"<?", "XML"},
                                                                   {"<!", "HTML"},
                                                                   {"<h", "HTML"}};
  for (const auto& [start, name] : kFormats) {
    if (bytes.starts_with(start)) return name;
  }
  const std::string_view after_length = bytes.substr(std::min<size_t>(bytes.size(), 4));
  return after_length.starts_with("ftypavif") ? "AVIF"
         : after_length.starts_with("JXL ")   ? "JPEG XL"
         : after_length.starts_with("jP  ")   ? "JPEG 2000"
                                              : nullptr;
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
  if (bytes.empty()) {
    why = "is empty";
    return {};
  }
  if (const char* foreign = foreign_format(bytes)) {
    why = std::string("is ") + foreign + ", which is not read";
    return {};
  }
  std::string marked;
  if (bytes.starts_with("\xFF\xD8")) {
    const JpegFrame frame = jpeg_frame(bytes);
    if (frame.components == 4 && !frame.adobe) {
      budget.charge(file, bytes.size());
      bytes = marked = with_adobe_marker(bytes);
    }
  }
  const bool webp = bytes.substr(0, 4) == "RIFF" && bytes.size() > 12 && bytes.substr(8, 4) == "WEBP";
  Picture picture = webp ? decode_webp(file, bytes, budget, why) : decode_stb(file, bytes, budget, why);
  for (size_t i = 3; i < picture.rgba.size() && !picture.has_alpha; i += 4)
    picture.has_alpha = picture.rgba[i] != 255;
  return picture;
}

}  // namespace lsp
