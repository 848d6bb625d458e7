#include "import/gltf_materials.h"

#include <algorithm>

#include "import/json_member.h"
#include "import/source_file.h"
#include "import/uri.h"
#include "lsp/program.h"

namespace lsp {

using nlohmann::json;

namespace {

const json& element(const json& list, int64_t index) {
  static const json kNull;
  return list.is_array() && index >= 0 && uint64_t(index) < list.size() ? list[size_t(index)] : kNull;
}

Wrap wrap_of(const json& sampler, const char* key) {
  constexpr int64_t kClampToEdge = 33071, kMirroredRepeat = 33648;
  const int64_t mode = index_member(sampler, key);
  return mode == kClampToEdge ? Wrap::kClamp : mode == kMirroredRepeat ? Wrap::kMirror : Wrap::kRepeat;
}

int64_t image_of(const json& texture) {
  const json& extensions = member(texture, "extensions");
  int64_t image = index_member(member(extensions, "EXT_texture_webp"), "source");
  if (image < 0) image = index_member(texture, "source");
  if (image < 0) image = index_member(member(extensions, "KHR_texture_basisu"), "source");
  return image;
}

}  // namespace

// The default material's members are those of an empty one.
const GltfMaterials::Entry& GltfMaterials::at(uint32_t index) {
  const json& source = element(member(document_.looks, "materials"), index);
  const uint32_t key = source.is_null() ? kNoIndex : index;
  if (key != index) note("primitives name materials that are not there, glTF's default holds for them");
  const auto [at, fresh] = materials_.try_emplace(key);
  if (!fresh) return at->second;
  const auto known = ids_.find(key);
  at->second = read(source, known == ids_.end() ? kNoIndex : known->second);
  ids_[key] = at->second.id;
  return at->second;
}

double GltfMaterials::number(const json& parent, const char* key, double fallback) {
  const json& value = member(parent, key);
  if (!value.is_null() && !value.is_number())
    note(std::string(key) + " of a material is no number and not read");
  return number_member(parent, key, fallback);
}

template <typename T>
void GltfMaterials::numbers(const json& parent, const char* key, size_t count, T* values) {
  if (!numbers_member(parent, key, count, values))
    note(std::string(key) + " of a material is not " + std::to_string(count) + " numbers and not read");
}

GltfMaterials::Entry GltfMaterials::read(const json& source, uint32_t known_id) {
  Material material;
  material.name = text_member(source, "name");
  float factor[4] = {1, 1, 1, 1};
  const json& pbr = member(source, "pbrMetallicRoughness");
  const json* base = &member(pbr, "baseColorTexture");
  numbers(pbr, "baseColorFactor", 4, factor);
  material.roughness = float(number(pbr, "roughnessFactor", 1));
  material.metallic = float(number(pbr, "metallicFactor", 1));
  numbers(source, "emissiveFactor", 3, &material.emission[0]);

  const json& extensions = member(source, "extensions");
  material.emission *=
      float(number(member(extensions, "KHR_materials_emissive_strength"), "emissiveStrength", 1));
  if (const json& glossy = member(extensions, "KHR_materials_pbrSpecularGlossiness"); glossy.is_object()) {
    std::fill(std::begin(factor), std::end(factor), 1.0f);
    numbers(glossy, "diffuseFactor", 4, factor);
    base = &member(glossy, "diffuseTexture");
    material.roughness = 1.0f - float(number(glossy, "glossinessFactor", 1));
    material.metallic = 0;
    float specular[3] = {1, 1, 1};
    numbers(glossy, "specularFactor", 3, specular);
    if (std::any_of(std::begin(specular), std::end(specular), [](float x) { return x != 0; }))
      note(
          "specular factors of KHR_materials_pbrSpecularGlossiness are not read, its materials are no "
          "metals");
    if (!member(glossy, "specularGlossinessTexture").is_null())
      note("specular-glossiness textures are not read, the glossiness factor holds");
  } else {
    mean_roughness(member(pbr, "metallicRoughnessTexture"), material);
  }
  if (member(extensions, "KHR_materials_unlit").is_object()) {
    material.roughness = 1;
    material.metallic = 0;
    note("unlit materials are taken as diffuse ones of their colour");
  }
  note_unread_textures(source);

  AlphaRule alpha;
  const std::string mode = text_member(source, "alphaMode");
  alpha.mode = mode == "MASK" ? AlphaMode::kMask : mode == "BLEND" ? AlphaMode::kBlend : AlphaMode::kOpaque;
  if (alpha.mode == AlphaMode::kOpaque && !mode.empty() && mode != "OPAQUE")
    note("the alphaMode " + mode + " is not known, OPAQUE is taken for it");
  alpha.factor = factor[3];
  alpha.cutoff = float(number(source, "alphaCutoff", 0.5));
  material.base_color = {factor[0], factor[1], factor[2]};
  material.opacity = alpha.coverage(1);
  Entry entry;
  entry.id = known_id != kNoIndex ? known_id : builder_.add_material(document_.file, material);
  const Material& bounded = builder_.mesh().materials[entry.id];
  entry.surface = {bounded.base_color, bounded.emission, alpha, texture(*base, alpha), {}};
  if (bounded.emission != glm::vec3(0)) entry.surface.glow = texture(member(source, "emissiveTexture"), {});
  return entry;
}

void GltfMaterials::note_unread_textures(const json& source) {
  if (!member(source, "normalTexture").is_null()) note("normal textures are not read");
  if (!member(source, "occlusionTexture").is_null()) note("occlusion textures are not read");
}

// A material has one roughness and one metalness: the factors times the means of the texture's green and
// blue.
void GltfMaterials::mean_roughness(const json& info, Material& material) {
  if (info.is_null()) return;
  const int64_t image = image_at(info);
  if (image < 0) return;
  const auto [at, fresh] = roughness_.try_emplace(image, -1.0);
  if (fresh) {
    const Picture picture = read_picture(image);
    glm::dvec2 sum(0);
    for (size_t i = 0; i < picture.rgba.size(); i += 4)
      sum += glm::dvec2(picture.rgba[i + 1], picture.rgba[i + 2]);
    if (!picture.rgba.empty()) at->second = sum * 4.0 / (255.0 * double(picture.rgba.size()));
    builder_.budget().release(picture.rgba.size() * 4);
  }
  if (at->second.x < 0) return;
  material.roughness *= float(at->second.x);
  material.metallic *= float(at->second.y);
  note("metallic-roughness textures are taken as their mean");
}

// The picture of the texture that a material names; -1, with a note, where there is none that is read.
int64_t GltfMaterials::image_at(const json& info) {
  const int64_t index = index_member(info, "index");
  const json& texture = element(member(document_.looks, "textures"), index);
  const int64_t image = image_of(texture);
  if (index < 0) {
    note("a texture without a number is not read; factors hold without it");
  } else if (texture.is_null()) {
    note("texture " + std::to_string(index) + " is not there; factors hold without it");
  } else if (image < 0) {
    note("texture " + std::to_string(index) + " names no picture that is read; factors hold without it");
  }
  return image;
}

TextureUse GltfMaterials::texture(const json& info, const AlphaRule& rule) {
  TextureUse use;
  if (info.is_null()) return use;
  const json& source = element(member(document_.looks, "textures"), index_member(info, "index"));
  const int64_t image = image_at(info);
  if (image < 0) return use;
  use.texture = picture(image, rule);
  const json& sampler = element(member(document_.looks, "samplers"), index_member(source, "sampler"));
  use.wrap_x = wrap_of(sampler, "wrapS");
  use.wrap_y = wrap_of(sampler, "wrapT");
  constexpr int64_t kNearest = 9728;
  use.nearest = index_member(sampler, "magFilter") == kNearest;
  use.set = int(std::min<int64_t>(index_member(info, "texCoord", 0), 1 << 20));
  if (const json& placed = member(member(info, "extensions"), "KHR_texture_transform"); placed.is_object()) {
    double scale[2] = {1, 1};
    numbers(placed, "scale", 2, scale);
    numbers(placed, "offset", 2, &use.offset[0]);
    const double angle = number(placed, "rotation", 0), c = std::cos(angle), s = std::sin(angle);
    use.linear = glm::dmat2(c * scale[0], -s * scale[0], s * scale[1], c * scale[1]);
    use.set = int(std::min<int64_t>(index_member(placed, "texCoord", use.set), 1 << 20));
  }
  return use;
}

std::string GltfMaterials::picture_bytes(const json& image) {
  if (const std::string uri = text_member(image, "uri"); !uri.empty()) {
    if (is_data_uri(uri)) return decode_data_uri(document_.file, uri);
    std::string remark;
    const std::filesystem::path path = resolve_uri(path_, uri, remark);
    std::string bytes = read_file(path, builder_.budget());
    builder_.budget().release(bytes.size());
    builder_.add_source(path);
    if (!remark.empty()) note(remark);
    return bytes;
  }
  const int64_t view = index_member(image, "bufferView");
  const Bytes bytes = accessors_.view(view >= 0 && view < 0x7FFFFFFF ? int(view) : -1);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// Empty, with a note that names it, where it cannot be had: the factors hold alone then.
Picture GltfMaterials::read_picture(int64_t image) {
  const json& source = element(member(document_.looks, "images"), image);
  const std::string uri = text_member(source, "uri"), given = text_member(source, "name");
  const std::string name = !uri.empty() && !is_data_uri(uri) ? uri
                           : !given.empty()                  ? given
                                                             : std::to_string(image);
  std::string why = "is not there";
  Picture picture;
  try {
    if (source.is_object())
      picture = decode_picture(document_.file, picture_bytes(source), builder_.budget(), why);
  } catch (const Failure& failure) {
    if (failure.exit() == Exit::kLimit) throw;
    why = failure.what();
  }
  if (picture.rgba.empty()) note("the picture " + name + " " + why + "; factors hold without it");
  return picture;
}

std::shared_ptr<Texture> GltfMaterials::picture(int64_t image, const AlphaRule& rule) {
  const auto [at, fresh] = pictures_.try_emplace({image, rule.mode, rule.factor, rule.cutoff});
  if (!fresh) return at->second;
  Picture picture = read_picture(image);
  if (picture.rgba.empty()) return nullptr;
  // The levels that may yet be made are charged at once.
  const uint64_t bytes = picture.rgba.size() * 7;
  builder_.budget().charge(document_.file, bytes);
  charged_ += bytes;
  return at->second = std::make_shared<Texture>(std::move(picture), rule);
}

void GltfMaterials::trim() {
  constexpr uint64_t kMuch = uint64_t{1} << 30;
  if (charged_ <= std::min(kMuch, builder_.budget().left() / 2)) return;
  materials_.clear();
  pictures_.clear();
  builder_.budget().release(charged_);
  charged_ = 0;
}

}  // namespace lsp
