#include "import/gltf_materials.h"

#include <algorithm>

#include "import/json_member.h"
#include "import/texture.h"

namespace lsp {

using nlohmann::json;

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

GltfMaterials::Entry GltfMaterials::read(const json& source, uint32_t known_id) {
  Material material;
  material.name = text_member(source, "name");
  float factor[4] = {1, 1, 1, 1};
  const json& pbr = member(source, "pbrMetallicRoughness");
  const json* base = &member(pbr, "baseColorTexture");
  numbers_.numbers(pbr, "baseColorFactor", 4, factor);
  material.roughness = float(numbers_.number(pbr, "roughnessFactor", 1));
  material.metallic = float(numbers_.number(pbr, "metallicFactor", 1));
  numbers_.numbers(source, "emissiveFactor", 3, &material.emission[0]);

  const json& extensions = member(source, "extensions");
  material.emission *=
      float(numbers_.number(member(extensions, "KHR_materials_emissive_strength"), "emissiveStrength", 1));
  if (const json& glossy = member(extensions, "KHR_materials_pbrSpecularGlossiness"); glossy.is_object()) {
    base = read_glossy(glossy, factor, material);
  } else {
    mean_roughness(member(pbr, "metallicRoughnessTexture"), material);
  }
  if (member(extensions, "KHR_materials_unlit").is_object()) {
    material.roughness = 1;
    material.metallic = 0;
    note("unlit materials are taken as diffuse ones of their colour");
  }
  note_unread_textures(source);

  AlphaRule alpha = alpha_rule(source, factor[3]);
  alpha.glass = glass_share(member(extensions, "KHR_materials_transmission"), material);
  material.emission /= 1 - alpha.glass;  // what is glass glows as if it were not
  material.base_color = {factor[0], factor[1], factor[2]};
  material.opacity = alpha.coverage(1);
  Entry entry;
  entry.id = known_id != kNoIndex ? known_id : builder_.add_material(document_.file, material);
  const Material& bounded = builder_.mesh().materials[entry.id];
  entry.surface = {bounded.base_color, bounded.emission, alpha, textures_.use(*base, alpha), {}};
  if (bounded.emission != glm::vec3(0))
    entry.surface.glow = textures_.use(member(source, "emissiveTexture"), {});
  return entry;
}

// KHR_materials_pbrSpecularGlossiness: returns the texture of the base colour. A black diffuse colour beside
// a bright specular one is a metal, of the specular colour; elsewhere the specular colour counts for nothing.
const json* GltfMaterials::read_glossy(const json& glossy, float (&factor)[4], Material& material) {
  static const json kNone;
  constexpr double kBlack = 0.04, kBright = 0.25;
  std::fill(std::begin(factor), std::end(factor), 1.0f);
  numbers_.numbers(glossy, "diffuseFactor", 4, factor);
  const json *diffuse = &member(glossy, "diffuseTexture"),
             &gloss = member(glossy, "specularGlossinessTexture");
  double specular[3] = {1, 1, 1}, glossiness = numbers_.number(glossy, "glossinessFactor", 1);
  numbers_.numbers(glossy, "specularFactor", 3, specular);
  const std::optional<glm::dvec4> gloss_mean = textures_.mean(gloss), diffuse_mean = textures_.mean(*diffuse);
  double most_diffuse = 0, most_specular = 0;
  for (int i = 0; i < 3; ++i) {
    if (gloss_mean) specular[i] *= linear_of_srgb((*gloss_mean)[i]);
    most_specular = std::max(most_specular, specular[i]);
    most_diffuse =
        std::max(most_diffuse, double(factor[i]) * (diffuse_mean ? linear_of_srgb((*diffuse_mean)[i]) : 1.0));
  }
  if (gloss_mean) {
    glossiness *= gloss_mean->a;
    note("specular-glossiness textures are taken as their mean");
  }
  material.roughness = 1.0f - float(glossiness);
  material.metallic = most_diffuse < kBlack && most_specular > kBright;
  if (material.metallic == 0) {
    if (most_specular > 0)
      note(
          "specular colours of KHR_materials_pbrSpecularGlossiness are not read where the diffuse one is not "
          "black, these materials are no metals");
    return diffuse;
  }
  for (int i = 0; i < 3; ++i) factor[i] = float(specular[i]);
  if (diffuse_mean)
    note("the diffuse textures of metals of KHR_materials_pbrSpecularGlossiness are not read");
  return &kNone;
}

AlphaRule GltfMaterials::alpha_rule(const json& source, float factor) {
  AlphaRule rule;
  const std::string mode = text_member(source, "alphaMode");
  rule.mode = mode == "MASK" ? AlphaMode::kMask : mode == "BLEND" ? AlphaMode::kBlend : AlphaMode::kOpaque;
  if (rule.mode == AlphaMode::kOpaque && !mode.empty() && mode != "OPAQUE")
    note("the alphaMode " + mode + " is not known, OPAQUE is taken for it");
  rule.factor = factor;
  rule.cutoff = float(numbers_.number(source, "alphaCutoff", 0.5));
  return rule;
}

// The share of light that glass lets pass. Metals let none; and of what comes from all sides, glass of index
// 1.5 reflects a share.
float GltfMaterials::glass_share(const json& transmission, const Material& material) {
  constexpr double kReflected = 0.09;
  double share = numbers_.number(transmission, "transmissionFactor", 0);
  if (!(share > 0)) return 0;
  if (const std::optional<glm::dvec4> mean = textures_.mean(member(transmission, "transmissionTexture")))
    share *= mean->r;
  note("what passes glass (KHR_materials_transmission) passes straight on and takes no colour from it");
  return float(std::min(share, 1.0) * (1 - kReflected) *
               (1 - std::clamp(double(material.metallic), 0.0, 1.0)));
}

void GltfMaterials::note_unread_textures(const json& source) {
  if (!member(source, "normalTexture").is_null()) note("normal textures are not read");
  if (!member(source, "occlusionTexture").is_null()) note("occlusion textures are not read");
}

// A material has one roughness and one metalness: the factors times the means of the texture's green and
// blue.
void GltfMaterials::mean_roughness(const json& info, Material& material) {
  const std::optional<glm::dvec4> mean = textures_.mean(info);
  if (!mean) return;
  material.roughness *= float(mean->g);
  material.metallic *= float(mean->b);
  note("metallic-roughness textures are taken as their mean");
}

void GltfMaterials::trim() {
  if (textures_.trim()) materials_.clear();
}

}  // namespace lsp
