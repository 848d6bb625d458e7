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
  if (WebPBitstreamFeatures features;
      WebPGetFeatures(data, bytes.size(), &features) == VP8_STATUS_OK && features.has_animation) {
    why = "is animated WebP, which is not read";
    return picture;
  }
  budget.charge(file, uint64_t(width) * uint64_t(height), 8);
  picture.rgba.resize(size_t(width) * size_t(height) * 4);
  if (!WebPDecodeRGBAInto(data, bytes.size(), picture.rgba.data(), picture.rgba.size(), width * 4)) return {};
  picture.width = uint32_t(width);
  picture.height = uint32_t(height);
  return picture;
}

// What a JPEG's markers say.
struct JpegFrame {
  size_t begin = 0;  // behind the marker of its start; 0: it is no JPEG
  int components = 0;
  bool adobe = false;   // a marker of Adobe's says what they are
  bool usable = true;   // no table has more codes than a byte can count
  bool turned = false;  // EXIF says that it is to be shown turned or mirrored
};

// What EXIF's first directory says of the picture's orientation, 1 where it says nothing. `tiff` begins with
// the order of its bytes.
uint32_t exif_orientation(std::string_view tiff) {
  constexpr size_t kEntryBytes = 12;
  constexpr uint32_t kOrientation = 0x0112;
  const bool big = tiff.starts_with("MM");
  const auto number = [&](size_t at, size_t bytes) {
    uint32_t value = 0;
    for (size_t i = 0; i < bytes; ++i) {
      const size_t from = at + (big ? i : bytes - 1 - i);
      value = value << 8 | (from < tiff.size() ? uint8_t(tiff[from]) : 0u);
    }
    return value;
  };
  if (!big && !tiff.starts_with("II")) return 1;
  const size_t directory = number(4, 4), count = number(directory, 2);
  for (size_t i = 0; i < count && directory + 2 + (i + 1) * kEntryBytes <= tiff.size(); ++i) {
    const size_t entry = directory + 2 + i * kEntryBytes;
    if (number(entry, 2) == kOrientation) return number(entry + 8, 2);
  }
  return 1;
}

// Whether the tables of codes in `length` bytes have at most 256 each: stb_image 2.27 writes what is beyond
// over what lies behind them. It reads a table to its end, even where the length ends before.
bool usable_tables(std::string_view rest, int64_t length) {
  constexpr size_t kCounts = 16;
  while (length > 0) {
    size_t codes = 0;
    for (size_t i = 1; i <= kCounts && i < rest.size(); ++i) codes += uint8_t(rest[i]);
    if (codes > 256) return false;
    rest.remove_prefix(std::min(rest.size(), 1 + kCounts + codes));
    length -= int64_t(1 + kCounts + codes);
  }
  return true;
}

// Follows markers as stb_image does: from one to the next by its length, and, where none is or coded data
// follow, to the next one that is neither a zero nor a restart.
JpegFrame jpeg_frame(std::string_view bytes) {
  JpegFrame frame;
  const size_t start = bytes.find_first_not_of('\xFF');
  if (start == 0 || start == bytes.npos || bytes[start] != '\xD8') return frame;
  frame.begin = start + 1;
  for (size_t at = frame.begin; at + 4 <= bytes.size();) {
    const auto marker = uint8_t(bytes[at + 1]);
    const bool is_restart = marker >= 0xD0 && marker <= 0xD7;
    if (uint8_t(bytes[at]) != 0xFF || marker == 0xFF || marker == 0 || is_restart) {
      ++at;
      continue;
    }
    if (marker == 0xD9) break;
    const size_t length = size_t{uint8_t(bytes[at + 2])} * 256 + uint8_t(bytes[at + 3]);
    const std::string_view rest = bytes.substr(at + 4);
    if (marker >= 0xC0 && marker <= 0xC2 && rest.size() > 5) frame.components = uint8_t(rest[5]);
    if (marker == 0xEE && rest.starts_with("Adobe")) frame.adobe = true;
    constexpr std::string_view kExif("Exif\0\0", 6);
    if (marker == 0xE1 && rest.starts_with(kExif) && length > 2 + kExif.size()) {
      const uint32_t orientation = exif_orientation(rest.substr(kExif.size(), length - 2 - kExif.size()));
      frame.turned = orientation > 1 && orientation <= 8;
    }
    if (marker == 0xC4 && !usable_tables(rest, int64_t(length) - 2)) frame.usable = false;
    at += 2 + length;
  }
  return frame;
}

// stb_image takes four components without Adobe's marker for luma and chroma; they are CMYK, and programs
// that show them take them to be as Adobe's.
std::string with_adobe_marker(std::string_view jpeg, size_t begin) {
  constexpr std::string_view kMarker(
      "\xFF\xEE\0\x0E"
      "Adobe\0\x64\0\0\0\0\0",
      16);
  return std::string(jpeg.substr(0, begin)).append(kMarker).append(jpeg.substr(begin));
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
  // What Xcode makes of PNG has blue first and is multiplied by its alpha.
  stbi_convert_iphone_png_to_rgb(1);
  stbi_set_unpremultiply_on_load(1);
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
  const JpegFrame frame = jpeg_frame(bytes);
  if (!frame.usable) {
    why = "is damaged";
    return {};
  }
  std::string marked;
  if (frame.begin && frame.components == 4 && !frame.adobe) {
    budget.charge(file, bytes.size());
    bytes = marked = with_adobe_marker(bytes, frame.begin);
  }
  const bool webp = bytes.substr(0, 4) == "RIFF" && bytes.size() > 12 && bytes.substr(8, 4) == "WEBP";
  Picture picture = webp ? decode_webp(file, bytes, budget, why) : decode_stb(file, bytes, budget, why);
  for (size_t i = 3; i < picture.rgba.size() && !picture.has_alpha; i += 4)
    picture.has_alpha = picture.rgba[i] != 255;
  picture.turned = frame.turned;
  return picture;
}

}  // namespace lsp
