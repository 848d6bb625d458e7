// Pictures of one view side by side on the page: what was rendered, how it differs, and where most.
#pragma once

#include <string>
#include <vector>

#include "image.h"
#include "report.h"

namespace lsp::bench {

inline constexpr float kAmplified = 4;  // how many times a difference is shown

struct Exhibit {
  std::string id;       // of the picture's file
  std::string name;     // in its caption
  std::string figures;  // after the name; may be empty
  Image image;          // linear light on a scale where 1 is white
};

struct Spot {
  uint32_t x = 0, y = 0, width = 0, height = 0;
};

// Of all parts of an eighth of the picture in width and height the one where the two differ most after a
// blur, of equal ones the first: not where noise is greatest, but where something is there that should not
// be.
Spot worst_spot(const Image& reference, const Image& image);

// |a - b| as it is seen, that is of display values, `kAmplified` times.
Image amplified_difference(const Image& a, const Image& b);

// Three rows: the exhibits, of which the first is the reference; their amplified differences to it; and the
// spot where exhibit `worst_of` is worst, enlarged, which is framed in red above. At least two exhibits.
PictureGrid exhibition(const std::string& title, const std::vector<Exhibit>& exhibits, size_t worst_of);

}  // namespace lsp::bench
