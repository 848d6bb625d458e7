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
  std::vector<uint8_t> rgba;  // row after row from the top, as stored: no colour is converted
};

// Decodes PNG (any depth, grey, palette), JPEG, WebP, TGA or BMP. On failure the picture is empty and `why`
// says, after "the picture", what is wrong. Hostile bytes are fine; what they declare is charged to the
// budget first (throws Failure kLimit, naming `file`).
Picture decode_picture(const std::string& file, std::string_view bytes, Budget& budget, std::string& why);

}  // namespace lsp
