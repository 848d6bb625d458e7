#include "import/texture.h"

#include <algorithm>
#include <array>

namespace lsp {
namespace {

const std::array<float, 256>& linear_table() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> made{};
    for (size_t i = 0; i < made.size(); ++i) made[i] = float(linear_of_srgb(double(i) / 255));
    return made;
  }();
  return table;
}

uint32_t wrapped(int64_t i, uint32_t size, Wrap wrap) {
  const int64_t n = size;
  if (wrap == Wrap::kClamp) return uint32_t(std::clamp<int64_t>(i, 0, n - 1));
  const int64_t period = wrap == Wrap::kMirror ? 2 * n : n;
  const int64_t within = (i % period + period) % period;
  return uint32_t(within < n ? within : period - 1 - within);
}

}  // namespace

double linear_of_srgb(double value) {
  return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
}

Texture::Texture(Picture picture, const AlphaRule& rule) : picture_(std::move(picture)), rule_(rule) {
  Size size{picture_.width, picture_.height};
  sizes_.push_back(size);
  while (size.width > 1 || size.height > 1) {
    size = {std::max(1u, (size.width + 1) / 2), std::max(1u, (size.height + 1) / 2)};
    sizes_.push_back(size);
  }
}

uint64_t Texture::bytes() const {
  uint64_t sum = picture_.rgba.size();
  for (const auto& level : coarse_) sum += level.size() * sizeof level[0];
  return sum;
}

glm::vec4 Texture::finest(uint32_t x, uint32_t y, float alpha) const {
  const uint8_t* texel = &picture_.rgba[(size_t{y} * picture_.width + x) * 4];
  const auto& linear = linear_table();
  const float coverage = rule_.coverage(alpha * float(texel[3]) / 255.0f);
  return glm::vec4(linear[texel[0]], linear[texel[1]], linear[texel[2]], 1) * coverage;
}

void Texture::make_levels(size_t level) {
  // Which texels of `from` a texel of `to` covers on one axis, and how much of each.
  struct Part {
    uint32_t first = 0, count = 0;
    float weights[4] = {};
  };
  const auto parts_of = [](uint32_t from, uint32_t to) {
    std::vector<Part> parts(to);
    for (uint32_t i = 0; i < to; ++i) {
      const double low = double(i) * from / to, high = double(i + 1) * from / to;
      parts[i].first = uint32_t(low);
      for (uint32_t k = parts[i].first; k < from && k < high && parts[i].count < 4; ++k) {
        const double share = std::min(high, k + 1.0) - std::max(low, double(k));
        parts[i].weights[parts[i].count++] = float(share * to / from);
      }
    }
    return parts;
  };
  while (coarse_.size() < level && coarse_.size() + 1 < sizes_.size()) {
    const size_t before = coarse_.size();
    const Size from = sizes_[before], to = sizes_[before + 1];
    const std::vector<Part> columns = parts_of(from.width, to.width), rows = parts_of(from.height, to.height);
    std::vector<glm::vec4> texels(size_t{to.width} * to.height);
    for (uint32_t y = 0; y < to.height; ++y) {
      for (uint32_t x = 0; x < to.width; ++x) {
        glm::vec4 sum(0);
        for (uint32_t j = 0; j < rows[y].count; ++j) {
          for (uint32_t i = 0; i < columns[x].count; ++i) {
            sum += texel(before, columns[x].first + i, rows[y].first + j, Wrap::kClamp, Wrap::kClamp) *
                   (rows[y].weights[j] * columns[x].weights[i]);
          }
        }
        texels[size_t{y} * to.width + x] = sum;
      }
    }
    coarse_.push_back(std::move(texels));
  }
}

glm::vec4 Texture::texel(size_t level, int64_t x, int64_t y, Wrap wrap_x, Wrap wrap_y) const {
  const Size size = sizes_[level];
  const uint32_t column = wrapped(x, size.width, wrap_x), row = wrapped(y, size.height, wrap_y);
  return level == 0 ? finest(column, row, 1) : coarse_[level - 1][size_t{row} * size.width + column];
}

glm::vec4 Texture::texel_times(float alpha, int64_t x, int64_t y, Wrap wrap_x, Wrap wrap_y) const {
  return finest(wrapped(x, picture_.width, wrap_x), wrapped(y, picture_.height, wrap_y), alpha);
}

float Texture::least_alpha(int64_t x, int64_t y, Wrap wrap_x, Wrap wrap_y) const {
  const size_t column = wrapped(x, picture_.width, wrap_x), row = wrapped(y, picture_.height, wrap_y);
  return rule_.least(float(picture_.rgba[(row * picture_.width + column) * 4 + 3]) / 255.0f);
}

glm::vec4 Texture::bilinear(const glm::dvec2& at, Wrap wrap_x, Wrap wrap_y) const {
  const double x = std::floor(at.x - 0.5), y = std::floor(at.y - 0.5);
  const auto right = float(at.x - 0.5 - x), down = float(at.y - 0.5 - y);
  const auto i = int64_t(x), j = int64_t(y);
  const glm::vec4 above = glm::mix(texel(0, i, j, wrap_x, wrap_y), texel(0, i + 1, j, wrap_x, wrap_y), right);
  const glm::vec4 below =
      glm::mix(texel(0, i, j + 1, wrap_x, wrap_y), texel(0, i + 1, j + 1, wrap_x, wrap_y), right);
  return glm::mix(above, below, down);
}

}  // namespace lsp
