#include "import/gltf_materials.h"

#include "import/json_member.h"

namespace lsp {

using nlohmann::json;

uint32_t GltfMaterials::at(uint32_t index) {
  const json& list = member(document_.looks, "materials");
  if (!list.is_array() || index >= list.size()) return builder_.default_material();
  const auto [at, fresh] = materials_.try_emplace(index, kNoIndex);
  if (fresh) at->second = builder_.add_material(read(list[index]));
  return at->second;
}

Material GltfMaterials::read(const json& source) {
  Material material;
  material.name = text_member(source, "name");
  double factor[4] = {1, 1, 1, 1};
  const json& pbr = member(source, "pbrMetallicRoughness");
  numbers_member(pbr, "baseColorFactor", 4, factor);
  material.roughness = float(number_member(pbr, "roughnessFactor", 1));
  material.metallic = float(number_member(pbr, "metallicFactor", 1));
  numbers_member(source, "emissiveFactor", 3, &material.emission[0]);

  const json& extensions = member(source, "extensions");
  material.emission *=
      float(number_member(member(extensions, "KHR_materials_emissive_strength"), "emissiveStrength", 1));
  if (const json& glossy = member(extensions, "KHR_materials_pbrSpecularGlossiness"); glossy.is_object()) {
    numbers_member(glossy, "diffuseFactor", 4, factor);
    material.roughness = 1.0f - float(number_member(glossy, "glossinessFactor", 1));
    material.metallic = 0;
  }
  if (member(extensions, "KHR_materials_unlit").is_object()) {
    material.roughness = 1;
    material.metallic = 0;
    builder_.note(document_.file + ": unlit materials are taken as diffuse ones of their colour");
  }
  material.base_color = {factor[0], factor[1], factor[2]};
  const std::string mode = text_member(source, "alphaMode");
  if (mode == "BLEND") material.opacity = float(factor[3]);
  if (mode == "MASK") material.opacity = factor[3] >= number_member(source, "alphaCutoff", 0.5) ? 1.0f : 0.0f;
  return material;
}

}  // namespace lsp
