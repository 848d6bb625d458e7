#include "import/gltf_primitive.h"

#include <algorithm>
#include <cmath>

#include "import/text.h"
#include "lsp/program.h"

namespace lsp {
namespace {

std::vector<glm::vec3> vectors_of(const std::vector<float>& values) {
  std::vector<glm::vec3> vectors(values.size() / 3);
  for (size_t i = 0; i < vectors.size(); ++i)
    vectors[i] = {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
  return vectors;
}

// Three vertices a triangle out of a strip or fan (glTF 2.0, section 3.7.2.1). Lists lose what is left over.
std::vector<uint32_t> expand(std::vector<uint32_t> vertices, int mode) {
  if (mode == TINYGLTF_MODE_TRIANGLES) {
    vertices.resize(vertices.size() / 3 * 3);
    return vertices;
  }
  std::vector<uint32_t> out;
  if (vertices.size() < 3) return out;
  out.reserve((vertices.size() - 2) * 3);
  for (size_t i = 0; i + 2 < vertices.size(); ++i) {
    if (mode == TINYGLTF_MODE_TRIANGLE_STRIP) {
      out.insert(out.end(), {vertices[i], vertices[i + 1 + i % 2], vertices[i + 2 - i % 2]});
    } else {
      out.insert(out.end(), {vertices[i + 1], vertices[i + 2], vertices[0]});
    }
  }
  return out;
}

// Primitives often share one vertex buffer, and each is placed once an instance: leave it what it uses.
void drop_unused(GltfPrimitive& primitive) {
  const size_t count = primitive.positions.size();
  std::vector<uint32_t> moved(count, kNoIndex), kept;
  for (uint32_t& index : primitive.indices) {
    if (index >= count) {
      index = kNoIndex;
      continue;
    }
    if (moved[index] == kNoIndex) {
      moved[index] = uint32_t(kept.size());
      kept.push_back(index);
    }
    index = moved[index];
  }
  const auto gather = [&](auto& values, size_t each) {
    if (values.empty()) return;
    std::remove_reference_t<decltype(values)> out;
    out.reserve(kept.size() * each);
    for (const uint32_t old : kept) {
      for (size_t k = 0; k < each; ++k) out.push_back(values[old * each + k]);
    }
    values = std::move(out);
  };
  gather(primitive.positions, 1);
  gather(primitive.normals, 1);
  gather(primitive.joints, primitive.joints_each);
  gather(primitive.weights, primitive.joints_each);
}

}  // namespace

GltfPrimitives::GltfPrimitives(const GltfDocument& document, GltfAccessors& accessors,
                               GltfMaterials& materials, MeshBuilder& builder)
    : document_(document),
      accessors_(accessors),
      materials_(materials),
      builder_(builder),
      draco_(document, accessors, builder) {}

void GltfPrimitives::fail(const std::string& what) const {
  throw Failure(Exit::kInvalid, document_.file, what + ", export it again");
}

const std::vector<GltfPrimitive>& GltfPrimitives::of(int mesh, const std::vector<double>& weights) {
  if (mesh < 0 || size_t(mesh) >= document_.model.meshes.size())
    fail("refers to mesh " + std::to_string(mesh) + ", which is not there");
  const tinygltf::Mesh& source = document_.model.meshes[size_t(mesh)];
  const bool morphs = std::any_of(source.primitives.begin(), source.primitives.end(),
                                  [](const tinygltf::Primitive& p) { return !p.targets.empty(); });
  const std::vector<double> none;
  const std::vector<double>& effective = !morphs ? none : weights.empty() ? source.weights : weights;
  const auto [at, fresh] = meshes_.try_emplace({mesh, effective});
  if (!fresh) return at->second;
  for (const tinygltf::Primitive& primitive : source.primitives) {
    const size_t targets = primitive.targets.size();
    if (!effective.empty() && targets != effective.size())
      builder_.note(document_.file + ": a mesh with " + std::to_string(targets) + " morph targets has " +
                    std::to_string(effective.size()) + " weights, those left over of either are not read");
    const int mode = primitive.mode < 0 ? TINYGLTF_MODE_TRIANGLES : primitive.mode;
    if (mode < TINYGLTF_MODE_TRIANGLES || mode > TINYGLTF_MODE_TRIANGLE_FAN) {
      ++skipped_modes_;
    } else if (!primitive.attributes.contains("POSITION")) {
      ++without_positions_;
    } else {
      // One without a triangle would be placed all the same, as often as there are instances.
      GltfPrimitive out = read(primitive, mode, effective);
      if (out.indices.size() >= 3) at->second.push_back(std::move(out));
    }
  }
  return at->second;
}

void GltfPrimitives::note_skipped() {
  if (skipped_modes_) {
    builder_.note(document_.file + ": " + std::to_string(skipped_modes_) +
                  " primitives are points or lines and hold no triangle");
  }
  if (without_positions_) {
    builder_.note(document_.file + ": " + std::to_string(without_positions_) +
                  " primitives have no positions");
  }
}

GltfPrimitive GltfPrimitives::read(const tinygltf::Primitive& source, int mode,
                                   const std::vector<double>& weights) {
  GltfPrimitive out;
  const auto values_of = [&](const char* name) {
    Values values = read_values(source, name, 0);
    morph(source, name, weights, values);
    return values;
  };
  out.positions = vectors_of(values_of("POSITION").floats);
  out.normals = vectors_of(values_of("NORMAL").floats);
  // Every element needs both; a file with fewer normals has lost them.
  if (!out.normals.empty() && out.normals.size() != out.positions.size()) {
    builder_.note(document_.file +
                  ": a primitive has fewer or more normals than positions, they are not used");
    out.normals.clear();
  }
  read_joints(source, out);
  const GltfDraco::Decoded* decoded = draco_.find(source);
  const auto indices = source.attributes.find(kGltfIndices);
  if (decoded) {
    out.indices = decoded->indices;
  } else {
    std::vector<uint32_t> vertices;
    if (indices != source.attributes.end()) {
      vertices = accessors_.indices(indices->second);
    } else {
      builder_.budget().charge(document_.file, out.positions.size(), sizeof(uint32_t));
      vertices.resize(out.positions.size());
      for (size_t i = 0; i < vertices.size(); ++i) vertices[i] = uint32_t(i);
    }
    if (mode == TINYGLTF_MODE_TRIANGLES && vertices.size() % 3 != 0)
      builder_.note(document_.file +
                    ": a primitive's vertices are no multiple of three, those left over hold no triangle");
    builder_.budget().charge(document_.file, vertices.size(), 3 * sizeof(uint32_t));
    out.indices = expand(std::move(vertices), mode);
  }
  read_colors(source, weights, out);
  if (source.targets.empty()) draco_.forget(source);  // it is not read again
  if (out.positions.size() > out.indices.size()) drop_unused(out);
  return out;
}

GltfPrimitives::Values GltfPrimitives::read_values(const tinygltf::Primitive& source, const std::string& name,
                                                   int components) {
  Values out;
  const auto found = source.attributes.find(name);
  if (found == source.attributes.end()) return out;
  out.components = components ? components : gltf_components(name, accessors_.at(found->second));
  const GltfDraco::Decoded* decoded = draco_.find(source);
  if (decoded && decoded->values.contains(name)) {
    out.floats = decoded->values.at(name);
    accessors_.overlay_sparse(found->second, out.components, out.floats);
  } else if (!decoded || accessors_.at(found->second).bufferView >= 0 || !GltfDraco::names(source, name)) {
    out.floats = accessors_.floats(found->second, out.components);
  }
  if (name == "COLOR_0") normalize_color(accessors_.at(found->second), out);
  return out;
}

// Colours in whole numbers are parts of the largest one; exporters forget to say so.
void GltfPrimitives::normalize_color(const tinygltf::Accessor& accessor, Values& values) {
  const bool bytes = accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE;
  if (accessor.normalized || (!bytes && accessor.componentType != TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT))
    return;
  for (float& value : values.floats) value /= bytes ? 255.0f : 65535.0f;
  builder_.note(document_.file +
                ": vertex colours in whole numbers are taken as normalized, which they do not say");
}

// Adds the targets' displacements, each by its weight (glTF 2.0, section 3.7.2.2).
void GltfPrimitives::morph(const tinygltf::Primitive& source, const std::string& name,
                           const std::vector<double>& weights, Values& values) {
  if (values.floats.empty()) return;
  for (size_t i = 0; i < std::min(source.targets.size(), weights.size()); ++i) {
    const auto target = source.targets[i].find(name);
    if (target == source.targets[i].end() || weights[i] == 0 || !std::isfinite(weights[i])) continue;
    const std::vector<float> moves =
        accessors_.floats(target->second, gltf_components(name, accessors_.at(target->second)));
    if (moves.size() != values.floats.size()) fail("has a morph target of another size than what it moves");
    for (size_t k = 0; k < moves.size(); ++k)
      values.floats[k] = float(double(values.floats[k]) + weights[i] * double(moves[k]));
  }
}

// The material and, where textures or vertices make one, each triangle's colour.
void GltfPrimitives::read_colors(const tinygltf::Primitive& source, const std::vector<double>& weights,
                                 GltfPrimitive& out) {
  const GltfMaterials::Entry& entry =
      materials_.at(source.material >= 0 ? uint32_t(source.material) : kNoIndex);
  out.material = entry.id;
  const auto values_of = [&](const std::string& name) {
    Values values = read_values(source, name, 0);
    morph(source, name, weights, values);
    return values;
  };
  const Values colors = values_of("COLOR_0");
  const bool colored =
      std::any_of(colors.floats.begin(), colors.floats.end(), [](float x) { return x != 1; });
  // What morph targets add up to is cut by the specification.
  const bool beyond =
      std::any_of(colors.floats.begin(), colors.floats.end(), [](float x) { return !(x >= 0 && x <= 1); });
  if (beyond && weights.empty())
    builder_.note(document_.file + ": vertex colours are cut to the range from 0 to 1");
  note_missing("COLOR_0", colors, out);
  const Surface& surface = entry.surface;
  if (!surface.has_textures() && !colored) return;
  const auto coordinates = [&](const TextureUse& use) {
    if (!use.texture) return std::vector<float>();
    const std::string name = "TEXCOORD_" + std::to_string(use.set);
    Values values = values_of(name);
    if (values.floats.empty())
      builder_.note(document_.file + ": a primitive has a texture and no " + name +
                    ", its corner texel holds");
    else
      note_missing(name, values, out);
    if (std::any_of(values.floats.begin(), values.floats.end(), [](float x) { return !std::isfinite(x); }))
      builder_.note(document_.file + ": " + name +
                    " is not finite at some vertices, the corner texel holds there");
    return std::move(values.floats);
  };
  const std::vector<float> base = coordinates(surface.base), glow = coordinates(surface.glow);
  const size_t count = out.indices.size() / 3;
  builder_.budget().charge(document_.file, count, sizeof(TriangleColor));
  const auto place = [](const TextureUse& use, const std::vector<float>& list, size_t i) {
    const bool there = 2 * i + 1 < list.size() && std::isfinite(list[2 * i] + list[2 * i + 1]);
    return use.place(there ? glm::dvec2(list[2 * i], list[2 * i + 1]) : glm::dvec2(0));
  };
  out.colors = mean_colors(surface, count, [&](size_t t, SurfaceCorner(&corners)[3]) {
    for (size_t k = 0; k < 3; ++k) {
      const size_t i = out.indices[3 * t + k], each = size_t(colors.components);
      corners[k].base_uv = place(surface.base, base, i);
      corners[k].glow_uv = place(surface.glow, glow, i);
      corners[k].color = glm::vec4(1);
      for (size_t c = 0; c < each && (i + 1) * each <= colors.floats.size(); ++c)
        corners[k].color[int(c)] = std::clamp(colors.floats[i * each + c], 0.0f, 1.0f);
    }
  });
  materials_.trim();
}

// Every element needs each attribute; a file with fewer has lost them.
void GltfPrimitives::note_missing(const std::string& name, const Values& values, const GltfPrimitive& out) {
  const size_t count = values.components ? values.floats.size() / size_t(values.components) : 0;
  if (count > 0 && count != out.positions.size())
    builder_.note(document_.file + ": a primitive has fewer or more of " + name +
                  " than positions, it is taken as it is");
}

// All sets of joints and weights, side by side for each position.
void GltfPrimitives::read_joints(const tinygltf::Primitive& source, GltfPrimitive& out) {
  std::vector<std::vector<float>> joints, weights;
  for (int set = 0; set < 64; ++set) {
    const std::string number = std::to_string(set);
    Values joint = read_values(source, "JOINTS_" + number, 4),
           weight = read_values(source, "WEIGHTS_" + number, 4);
    if (joint.floats.empty() != weight.floats.empty())
      builder_.note(document_.file +
                    ": a primitive has joints without weights or weights without joints, set " + number +
                    " of them is not read");
    if (joint.floats.empty() || weight.floats.empty()) break;
    if (joint.floats.size() != 4 * out.positions.size() || weight.floats.size() != joint.floats.size())
      fail("has more or fewer joints or weights than positions");
    joints.push_back(std::move(joint.floats));
    weights.push_back(std::move(weight.floats));
  }
  for (const auto& [name, accessor] : source.attributes) {
    const size_t number = name.find('_') + 1;
    int64_t set = 0;
    if ((name.starts_with("JOINTS_") || name.starts_with("WEIGHTS_")) &&
        !(integer_of(std::string_view(name).substr(number), set) && set <= int64_t(joints.size())))
      builder_.note(document_.file + ": " + name + " has no set before it and is not read");
  }
  if (joints.empty()) return;
  out.joints_each = 4 * joints.size();
  builder_.budget().charge(document_.file, out.positions.size() * out.joints_each, 2 * sizeof(uint32_t));
  for (size_t i = 0; i < out.positions.size(); ++i) {
    for (size_t set = 0; set < joints.size(); ++set) {
      for (size_t k = 4 * i; k < 4 * i + 4; ++k) {
        const float joint = joints[set][k], weight = weights[set][k];
        out.joints.push_back(joint >= 0 && joint < 65536 ? uint32_t(joint) : kNoIndex);
        out.weights.push_back(weight > 0 && std::isfinite(weight) ? weight : 0.0f);
      }
    }
  }
}

}  // namespace lsp
