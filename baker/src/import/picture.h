// Pictures as textures hold them.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "import/budget.h"

namespace lsp {

struct Picture {
  uint32_t width = 0, height = 0;
  bool has_alpha = false;     // some texel's is not 255
  bool turned = false;        // EXIF says that it is to be shown turned or mirrored, which it is not here
  std::vector<uint8_t> rgba;  // row after row from the top, as stored: no colour is converted
};

// What a note says, after its name, of a picture that is `turned`.
inline constexpr const char* kTurned =
    " is read as it is stored, the turn that its EXIF data ask for is not made";

// Decodes PNG (any depth, grey, palette), JPEG, WebP, TGA or BMP. On failure the picture is empty and `why`
// says, after "the picture", what is wrong. Hostile bytes are fine; what they declare is charged to the
// budget first (throws Failure kLimit, naming `file`).
Picture decode_picture(const std::string& file, std::string_view bytes, Budget& budget, std::string& why);

}  // namespace lsp
