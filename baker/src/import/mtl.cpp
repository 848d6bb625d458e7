#include "import/mtl.h"

#include <algorithm>
#include <cmath>

#include "import/source_file.h"
#include "import/text.h"

namespace lsp {
namespace {

constexpr size_t kLongestWord = 32;  // that a note repeats

// "r g b", or one number for all three. False, with the colour as it was, for anything else: spectral curves
// and CIE colours ("spectral f.rfl", "xyz x y z").
bool read_color(std::string_view line, glm::vec3& color) {
  double value[3];
  int count = 0;
  for (std::string_view word; count < 3 && take_word(line, word); ++count) value[count] = number_of(word);
  if ((count != 1 && count != 3) || !std::isfinite(value[0])) return false;
  if (count == 1) value[1] = value[2] = value[0];
  if (!std::isfinite(value[1]) || !std::isfinite(value[2])) return false;
  color = glm::vec3(value[0], value[1], value[2]);
  return true;
}

bool read_factor(std::string_view line, float& factor, std::set<std::string>& notes) {
  std::string_view word;
  if (!take_word(line, word)) return false;
  if (word == "-halo") {
    notes.insert("the option -halo of d is not read");
    if (!take_word(line, word)) return false;
  }
  const double value = number_of(word);
  if (std::isfinite(value)) factor = float(value);
  return std::isfinite(value);
}

// Whether numbers of an option that is not read are those that change nothing.
bool says_nothing(std::string_view option, const glm::dvec2& values) {
  return equals_ignoring_case(option, "-texres") ||
         values == (equals_ignoring_case(option, "-bm") ? glm::dvec2(1, 0) : glm::dvec2(0));
}

// "-option values... file name", which may hold spaces. Numbers end an option's values: -o, -s and -t take
// one to three of them.
MtlMap read_map(std::string_view line, std::set<std::string>& notes) {
  MtlMap map;
  const auto take_numbers = [&](int most, glm::dvec2& to) {
    for (int i = 0; i < most; ++i) {
      std::string_view ahead = line, word;
      if (!take_word(ahead, word)) return;
      const double value = number_of(word);
      if (!std::isfinite(value)) return;
      if (i < 2) to[i] = value;
      line = ahead;
    }
  };
  while (true) {
    std::string_view ahead = line, option, value;
    if (!take_word(ahead, option) || option.size() < 2 || option[0] != '-' ||
        (option[1] >= '0' && option[1] <= '9') || trim(ahead).empty())
      break;  // a file's name may begin so, too
    line = ahead;
    const auto is = [&](std::string_view name) { return equals_ignoring_case(option, name); };
    if (is("-o")) {
      take_numbers(3, map.offset);
    } else if (is("-s")) {
      take_numbers(3, map.scale);
    } else if (is("-mm")) {
      glm::dvec2 range(map.base, map.gain);
      take_numbers(2, range);
      map.base = range.x;
      map.gain = range.y;
    } else if (is("-t") || is("-bm") || is("-boost") || is("-texres")) {
      glm::dvec2 values(0);
      take_numbers(is("-t") ? 3 : 1, values);
      if (!says_nothing(option, values))
        notes.insert("the option " + std::string(option) + " of a map is not read");
    } else if (take_word(line, value)) {
      if (is("-clamp")) {
        map.clamp = equals_ignoring_case(value, "on");
      } else if (is("-imfchan")) {
        map.channel = value[0];
      } else if (is("-cc") ? equals_ignoring_case(value, "on")
                           : !is("-blendu") && !is("-blendv") && !is("-type")) {
        notes.insert("the option " + std::string(option.substr(0, kLongestWord)) + " of a map is not read");
      }
    }
  }
  map.file = std::string(unquoted(trim(line)));
  return map;
}

// Where a map goes that is read; exporters write its name in any case.
MtlMap* map_by(std::string_view word, MtlMaterial& entry) {
  return equals_ignoring_case(word, "map_Kd")   ? &entry.color
         : equals_ignoring_case(word, "map_Ke") ? &entry.emission
         : equals_ignoring_case(word, "map_d")  ? &entry.opacity
                                                : nullptr;
}

// Statements that no diffuse light depends on, or that lost to another (Tr, Ns).
bool says_no_color(std::string_view word) {
  constexpr std::string_view kWords[] = {"Ka", "Ni", "illum", "sharpness", "Pcr", "anisor", "Tr", "Ns"};
  return word.starts_with('#') || std::any_of(std::begin(kWords), std::end(kWords), [&](std::string_view w) {
           return equals_ignoring_case(w, word);
         });
}

// Whether a statement has another value than the one that exporters write where there is nothing to say: for
// Ks a grey of at most 0.5, which is what any varnish reflects.
bool says_something(std::string_view word, std::string_view line) {
  const auto is = [&](std::string_view keyword) { return equals_ignoring_case(word, keyword); };
  glm::vec3 value(0);
  if (!read_color(line, value)) return true;
  if (is("Ks")) return value.x > 0.5f || value.y != value.x || value.z != value.x;
  if (is("Tf")) return value != glm::vec3(1);
  return !(is("Ps") || is("Pc") || is("aniso")) || value != glm::vec3(0);
}

}  // namespace

void read_mtl(const std::filesystem::path& path, Budget& budget,
              std::map<std::string, MtlMaterial>& materials, std::set<std::string>& notes) {
  const std::string text = read_text(path, budget);
  std::string_view rest = text, line, word;
  MtlMaterial unnamed, *entry = &unnamed;
  bool rough_given = false, solid_given = false, color_given = false, emission_given = false;
  const auto end_material = [&] {
    const auto settle = [&](const char* name, bool given, const MtlMap& map, glm::vec3& factor) {
      if (map.file.empty() || (given && factor != glm::vec3(0))) return;
      if (given)
        notes.insert(std::string(name) + " of 0 beside its map is taken as 1, it would leave nothing of it");
      factor = glm::vec3(1);
    };
    settle("Kd", color_given, entry->color, entry->material.base_color);
    settle("Ke", emission_given, entry->emission, entry->material.emission);
  };
  std::string joined;
  bool named = false;
  while (take_joined_line(rest, line, joined)) {
    if (!take_word(line, word)) continue;
    if (!named && !word.starts_with('#') && !equals_ignoring_case(word, "newmtl")) {
      notes.insert("statements before the first newmtl are of no material and not read");
      continue;
    }
    named = named || !word.starts_with('#');
    const auto is = [&](std::string_view keyword) { return equals_ignoring_case(word, keyword); };
    if (is("newmtl")) {
      end_material();
      const std::string name(trim(line));
      budget.charge(path.string(), sizeof(MtlMaterial) + 64 + 2 * name.size());
      const auto [at, fresh] = materials.try_emplace(name, MtlMaterial{});
      entry = fresh ? &at->second : &unnamed;
      if (!fresh)
        notes.insert("the material " + name.substr(0, 100) +
                     " is defined more than once, its first definition holds");
      entry->material.name = name;
      rough_given = solid_given = color_given = emission_given = false;
      continue;
    }
    Material& material = entry->material;
    float factor = 0;
    if (is("Kd") || is("Ke")) {
      const bool glow = is("Ke");
      (glow ? emission_given : color_given) = true;
      if (!read_color(line, glow ? material.emission : material.base_color))
        notes.insert("a " + std::string(word) + " that is no three numbers is not read");
    } else if (is("d") && read_factor(line, factor, notes)) {
      material.opacity = factor;
      solid_given = true;
    } else if (is("Tr") && !solid_given && read_factor(line, factor, notes)) {
      material.opacity = 1.0f - factor;
    } else if (is("Pr") && read_factor(line, factor, notes)) {
      material.roughness = factor;
      rough_given = true;
    } else if (is("Pm") && read_factor(line, factor, notes)) {
      material.metallic = factor;
    } else if (is("Ns") && !rough_given && read_factor(line, factor, notes) && factor >= 0) {
      material.roughness = std::sqrt(2.0f / (factor + 2.0f));  // the Beckmann width of a Phong lobe
    } else if (MtlMap* map = map_by(word, *entry)) {
      budget.charge(path.string(), 2 * line.size() + 64);
      *map = read_map(line, notes);
    } else if (equals_ignoring_case(word.substr(0, 4), "map_") || word == "bump" || word == "norm" ||
               word == "disp" || word == "decal" || word == "refl") {
      notes.insert(std::string(word) + " is not read");
    } else if (!says_no_color(word) && says_something(word, line)) {
      constexpr size_t kMostNotes = 100;
      if (notes.size() < kMostNotes) notes.insert(std::string(word.substr(0, kLongestWord)) + " is not read");
    }
  }
  end_material();
}

}  // namespace lsp
