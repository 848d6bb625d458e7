#include "import/mtl.h"

#include <cmath>

#include "import/source_file.h"
#include "import/text.h"

namespace lsp {
namespace {

// "r g b", or one number for all three. Spectral curves and CIE colours ("spectral f.rfl", "xyz x y z") leave
// the colour as it was.
void read_color(std::string_view line, glm::vec3& color) {
  double value[3];
  int count = 0;
  for (std::string_view word; count < 3 && take_word(line, word); ++count) value[count] = number_of(word);
  if (count == 0 || !std::isfinite(value[0])) return;
  if (count < 3) value[1] = value[2] = value[0];
  if (std::isfinite(value[1]) && std::isfinite(value[2])) color = glm::vec3(value[0], value[1], value[2]);
}

bool read_factor(std::string_view line, float& factor) {
  std::string_view word;
  if (!take_word(line, word)) return false;
  if (word == "-halo" && !take_word(line, word)) return false;
  const double value = number_of(word);
  if (std::isfinite(value)) factor = float(value);
  return std::isfinite(value);
}

}  // namespace

void read_mtl(const std::filesystem::path& path, Budget& budget, std::map<std::string, Material>& materials) {
  const std::string text = read_text(path, budget);
  std::string_view rest = text, line, word;
  Material unnamed;
  Material* material = &unnamed;
  bool rough_given = false;
  while (take_line(rest, line)) {
    if (!take_word(line, word)) continue;
    if (word == "newmtl") {
      const std::string name(trim(line));
      budget.charge(path.string(), sizeof(Material) + 64 + 2 * name.size());
      const auto [at, fresh] = materials.try_emplace(name, Material{});
      material = fresh ? &at->second : &unnamed;
      material->name = name;
      rough_given = false;
      continue;
    }
    float factor = 0;
    if (word == "Kd") {
      read_color(line, material->base_color);
    } else if (word == "Ke") {
      read_color(line, material->emission);
    } else if (word == "d" && read_factor(line, factor)) {
      material->opacity = factor;
    } else if (word == "Tr" && read_factor(line, factor)) {
      material->opacity = 1.0f - factor;
    } else if (word == "Pr" && read_factor(line, factor)) {
      material->roughness = factor;
      rough_given = true;
    } else if (word == "Pm" && read_factor(line, factor)) {
      material->metallic = factor;
    } else if (word == "Ns" && !rough_given && read_factor(line, factor) && factor >= 0) {
      material->roughness = std::sqrt(2.0f / (factor + 2.0f));  // the Beckmann width of a Phong lobe
    }
  }
}

}  // namespace lsp
