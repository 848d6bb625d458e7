#include "picture_page.h"

#include <algorithm>

#include "picture_errors.h"
#include "same_size.h"

namespace lsp::bench {

Spot worst_spot(const Image& reference, const Image& image) {
  require_same_size(reference, image);
  const Image a = blurred(reference), b = blurred(image);
  const uint32_t width = std::max(1u, image.width / 8), height = std::max(1u, image.height / 8);
  Spot best{0, 0, width, height};
  double most = -1;
  for (uint32_t y = 0; y + height <= image.height; ++y) {
    for (uint32_t x = 0; x + width <= image.width; ++x) {
      double sum = 0;
      for (uint32_t j = y; j < y + height; ++j) {
        for (uint32_t i = x; i < x + width; ++i) {
          const glm::vec3 off = glm::abs(a.at(i, j) - b.at(i, j));
          sum += off.r + off.g + off.b;
        }
      }
      if (sum > most) {
        most = sum;
        best.x = x;
        best.y = y;
      }
    }
  }
  return best;
}

Image amplified_difference(const Image& a, const Image& b) {
  require_same_size(a, b);
  const Image shown_a = to_display(a), shown_b = to_display(b);
  Image out(a.width, a.height);
  for (size_t i = 0; i < out.pixels.size(); ++i) {
    out.pixels[i] = glm::min(kAmplified * glm::abs(shown_a.pixels[i] - shown_b.pixels[i]), glm::vec3(1));
  }
  return out;
}

PictureGrid exhibition(const std::string& title, const std::vector<Exhibit>& exhibits, size_t worst_of) {
  PictureGrid grid;
  grid.title = title;
  grid.columns = exhibits.size();
  const Image& reference = exhibits.front().image;
  const Spot spot = worst_spot(reference, exhibits.at(worst_of).image);
  std::vector<Picture> differences, details;
  for (size_t k = 0; k < exhibits.size(); ++k) {
    const Exhibit& exhibit = exhibits[k];
    Image display = to_display(exhibit.image);
    details.push_back({exhibit.id + "-detail", k == 0 ? "the framed part, enlarged" : "",
                       encode_png(crop(display, spot.x, spot.y, spot.width, spot.height))});
    differences.push_back({exhibit.id + "-difference", k == 0 ? "difference to this picture, times 4" : "",
                           encode_jpeg(amplified_difference(reference, exhibit.image)), true});
    draw_frame(display, spot.x, spot.y, spot.width, spot.height, {1, 0.1f, 0.1f});
    grid.pictures.push_back({exhibit.id, exhibit.name + exhibit.figures, encode_jpeg(display), true});
  }
  grid.pictures.insert(grid.pictures.end(), differences.begin(), differences.end());
  grid.pictures.insert(grid.pictures.end(), details.begin(), details.end());
  return grid;
}

}  // namespace lsp::bench
