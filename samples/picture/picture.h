// Pictures of linear RGB floats, and the two files they are kept in: .pfm (the floats) and .png (for the
// eye).
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/glm.hpp>
#include <string>
#include <vector>

namespace lsp::sample {

struct Picture {
  int width = 0;
  int height = 0;
  std::vector<glm::vec3> pixels;  // rows from the top, left to right

  Picture() = default;
  Picture(int w, int h) : width(w), height(h), pixels(static_cast<size_t>(w) * static_cast<size_t>(h)) {}
};

// A filmic curve (Narkowicz's fit to the ACES reference transform) from linear radiance to linear display
// light.
glm::vec3 tone_map(glm::vec3 radiance);

enum class Transfer {
  kToneMapped,  // tone_map, then sRGB
  kDisplay,     // values are display light already: sRGB alone
};

// Throws lsp::Failure (kUsage) unless `path` ends as pictures do, .pfm or .png, in small letters or capitals.
void check_picture_name(const std::filesystem::path& path);

// Writes by the ending of `path`, which is checked as above. .pfm ignores `transfer` and keeps the floats.
void write_picture(const std::filesystem::path& path, const Picture& picture, Transfer transfer);

// The bytes of a .png file of eight bits a channel: red, green, blue and alpha, rows from the top.
std::string rgba_png(int width, int height, const std::vector<uint8_t>& rgba);

// Reads a colour .pfm file, of either byte order. Hostile bytes are fine. Throws lsp::Failure: kFile where it
// cannot be read, kInvalid where it is not such a file or a pixel of it is not finite.
Picture read_pfm(const std::filesystem::path& path);

}  // namespace lsp::sample
