#include "import/mtl_textures.h"

#include <algorithm>
#include <cmath>

#include "import/find_file.h"
#include "import/source_file.h"
#include "import/text.h"
#include "lsp/program.h"

namespace lsp {
namespace {

// All that decides a texture, in one text.
std::string key_of(const MtlMaterial& source, const MtlMap& map) {
  std::string key = (source.folder / map.file).string() + '\0' + map.channel + (map.clamp ? 'c' : 'r');
  for (const double value : {map.scale.x, map.scale.y, map.offset.x, map.offset.y, map.base, map.gain})
    key += ' ' + std::to_string(value);
  return key;
}

// Puts the opacity map's values, at the nearest texel, where the colour map's alpha is. The result has the
// size of the larger of both.
Picture with_alpha(const Picture& color, const Picture& opacity, char channel) {
  Picture out;
  out.width = std::max(color.width, opacity.width);
  out.height = std::max(color.height, opacity.height);
  out.has_alpha = true;
  out.rgba.resize(size_t{out.width} * out.height * 4, 255);
  const auto texel = [&](const Picture& from, uint32_t x, uint32_t y) {
    const uint64_t column = uint64_t{x} * from.width / out.width,
                   row = uint64_t{y} * from.height / out.height;
    return &from.rgba[(row * from.width + column) * 4];
  };
  if (!channel) channel = opacity.has_alpha ? 'm' : 'l';
  for (uint32_t y = 0; y < out.height; ++y) {
    for (uint32_t x = 0; x < out.width; ++x) {
      uint8_t* to = &out.rgba[(size_t{y} * out.width + x) * 4];
      if (!color.rgba.empty()) std::copy_n(texel(color, x, y), 3, to);
      const uint8_t* from = texel(opacity, x, y);
      to[3] = channel == 'r'   ? from[0]
              : channel == 'g' ? from[1]
              : channel == 'b' ? from[2]
              : channel == 'm' ? from[3]
                               : uint8_t((from[0] * 2126 + from[1] * 7152 + from[2] * 722 + 5000) / 10000);
    }
  }
  return out;
}

// What -mm makes of the stored values, colours and alpha alike: a program that shows the picture brighter
// knows nothing of linear light. Whether any was clipped.
bool change_range(Picture& picture, double base, double gain) {
  uint8_t table[256];
  bool clips[256], clipped = false;
  for (int i = 0; i < 256; ++i) {
    const double value = 255 * base + gain * i, inside = std::min(std::max(value, 0.0), 255.0);
    table[i] = uint8_t(inside + 0.5);
    clips[i] = std::abs(value - inside) > 0.5;
  }
  for (size_t i = 0; i < picture.rgba.size(); ++i) {
    uint8_t& value = picture.rgba[i];
    clipped = clipped || (clips[value] && (i % 4 != 3 || picture.has_alpha));
    value = table[value];
  }
  return clipped;
}

}  // namespace

uint32_t MtlTextures::add(const MtlMaterial& source, std::map<uint32_t, Surface>& surfaces) {
  const uint32_t id = builder_.add_material(file_, source.material);
  if (source.color.file.empty() && source.emission.file.empty() && source.opacity.file.empty()) return id;
  const Material& material = builder_.mesh().materials[id];
  Surface surface{material.base_color, material.emission, {AlphaMode::kBlend, material.opacity}, {}, {}};
  const bool masked = !source.opacity.file.empty();
  if (!masked && material.opacity == 1) surface.alpha.mode = AlphaMode::kOpaque;

  const auto [base, fresh] = known_.try_emplace(
      key_of(source, source.color) + key_of(source, source.opacity) + std::to_string(material.opacity));
  if (fresh) {
    Picture color = read(source, source.color);
    // Colour and opacity are one texture; the alpha of a colour map says nothing (map_d does).
    if (!masked) {
      if (color.has_alpha)
        builder_.note(file_ + ": the alpha of map_Kd is not read, map_d would say what is solid");
      for (size_t i = 3; i < color.rgba.size(); i += 4) color.rgba[i] = 255;
    } else if (const Picture opacity = read(source, source.opacity); !opacity.rgba.empty()) {
      const uint64_t texels =
          uint64_t{std::max(color.width, opacity.width)} * std::max(color.height, opacity.height);
      builder_.budget().charge(file_, texels, 4);
      const MtlMap &a = source.color, &b = source.opacity;
      if (!color.rgba.empty() && (a.scale != b.scale || a.offset != b.offset || a.clamp != b.clamp))
        builder_.note(file_ + ": a map_d is placed as the map_Kd beside it, its own options are not read");
      color = with_alpha(color, opacity, source.opacity.channel);
    }
    base->second =
        use(source.color.file.empty() ? source.opacity : source.color, std::move(color), surface.alpha);
  }
  surface.base = base->second;
  if (!source.emission.file.empty() && material.emission != glm::vec3(0)) {
    const auto [glow, unseen] = known_.try_emplace("glow " + key_of(source, source.emission));
    if (unseen) glow->second = use(source.emission, read(source, source.emission), {});
    surface.glow = glow->second;
  }
  if (surface.has_textures()) surfaces[id] = surface;
  return id;
}

// Empty, with a note, where it cannot be had.
Picture MtlTextures::read(const MtlMaterial& source, const MtlMap& map) {
  Picture picture;
  if (map.file.empty()) return picture;
  std::string why = "is not there";
  bool guessed = false;
  std::filesystem::path path = find_file(source.folder, map.file, guessed);
  // A comment may stand behind it, but names hold '#', too.
  const std::string uncommented = map.file.substr(0, map.file.find(" #"));
  if (path.empty() && uncommented != map.file)
    path = find_file(source.folder, std::string(unquoted(trim(uncommented))), guessed);
  if (const auto folder = std::filesystem::path(file_).parent_path();
      path.empty() && folder != source.folder) {
    path = find_file(folder, map.file, guessed);  // some exporters name what lies beside the mesh
    guessed = true;
  }
  if (path.empty()) {
    builder_.add_missing(path_beside(source.folder, map.file));
  } else {
    if (guessed) builder_.note(file_ + ": the picture " + map.file + " is read from " + path.string());
    const std::string bytes = read_file(path, builder_.budget());
    builder_.add_source(path);
    picture = decode_picture(file_, bytes, builder_.budget(), why);
    builder_.budget().release(bytes.size());
    if ((map.base != 0 || map.gain != 1) && change_range(picture, map.base, map.gain))
      builder_.note(file_ + ": the option -mm takes values of the picture " + map.file +
                    " out of 0 to 1, they are clipped");
  }
  if (picture.turned) builder_.note(file_ + ": the picture " + map.file + kTurned);
  if (picture.rgba.empty())
    builder_.note(file_ + ": the picture " + map.file + " " + why + "; factors hold without it");
  return picture;
}

TextureUse MtlTextures::use(const MtlMap& map, Picture picture, const AlphaRule& rule) {
  TextureUse use;
  if (picture.rgba.empty()) return use;
  builder_.budget().charge(file_, picture.rgba.size(), 7);
  use.texture = std::make_shared<Texture>(std::move(picture), rule);
  use.wrap_x = use.wrap_y = map.clamp ? Wrap::kClamp : Wrap::kRepeat;
  // In OBJ v grows upwards: v' = 1 - (scale * (1 - v) + offset).
  use.linear = glm::dmat2(map.scale.x, 0, 0, map.scale.y);
  use.offset = {map.offset.x, 1 - map.scale.y - map.offset.y};
  return use;
}

}  // namespace lsp
