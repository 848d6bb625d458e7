#include "import/gltf_draco_primitives.h"

#include "lsp/program.h"

namespace lsp {
namespace {

constexpr const char* kExtension = "KHR_draco_mesh_compression";

// The number of an attribute in Draco's data, -1 where it is not in there.
int draco_id(const tinygltf::Value& extension, const std::string& name) {
  if (!extension.IsObject() || !extension.Get("attributes").IsObject()) return -1;
  const tinygltf::Value& value = extension.Get("attributes").Get(name);
  return value.IsInt() ? value.Get<int>() : -1;
}

}  // namespace

GltfDraco::GltfDraco(const GltfDocument& document, GltfAccessors& accessors, MeshBuilder& builder)
    : document_(document), accessors_(accessors) {
  const tinygltf::Model& model = document_.model;
  std::vector<bool> placed(model.meshes.size(), false);
  for (const tinygltf::Node& node : model.nodes) {
    if (node.mesh >= 0 && size_t(node.mesh) < placed.size()) placed[size_t(node.mesh)] = true;
  }
  std::vector<DracoJob> jobs;
  std::vector<const tinygltf::Primitive*> sources;
  std::vector<std::vector<std::string>> names;
  for (size_t mesh = 0; mesh < placed.size(); ++mesh) {
    if (!placed[mesh]) continue;
    for (const tinygltf::Primitive& source : model.meshes[mesh].primitives) {
      if (!source.extensions.contains(kExtension) || !source.attributes.contains("POSITION")) continue;
      jobs.push_back(job_of(source, names.emplace_back()));
      sources.push_back(&source);
    }
  }
  if (jobs.empty()) return;
  std::vector<DracoMesh> meshes = decode_draco_fenced(document_.file, jobs, builder.budget());
  for (size_t i = 0; i < sources.size(); ++i) {
    Decoded& decoded = decoded_[sources[i]];
    decoded.indices = std::move(meshes[i].indices);
    for (size_t k = 0; k < names[i].size(); ++k) {
      if (meshes[i].values[k].empty()) {
        builder.note(document_.file + ": the compressed attribute " + names[i][k] + " cannot be read");
      } else {
        decoded.values[names[i][k]] = std::move(meshes[i].values[k]);
      }
    }
  }
}

DracoJob GltfDraco::job_of(const tinygltf::Primitive& source, std::vector<std::string>& names) {
  const tinygltf::Value& extension = source.extensions.at(kExtension);
  const auto id = [&](const std::string& name) { return draco_id(extension, name); };
  const tinygltf::Value none;
  const tinygltf::Value& view = extension.IsObject() ? extension.Get("bufferView") : none;
  if (!view.IsInt() || id("POSITION") < 0)
    throw Failure(Exit::kInvalid, document_.file,
                  "has KHR_draco_mesh_compression without a buffer view or positions, export it again");
  DracoJob job{accessors_.view(view.Get<int>()), {}};
  for (const auto& [name, accessor] : source.attributes) {
    if (name == kGltfIndices || id(name) < 0) continue;
    job.attributes.push_back({id(name), gltf_components(name, accessors_.at(accessor)),
                              accessors_.at(accessor).normalized, name == "POSITION" || name == "NORMAL"});
    names.push_back(name);
  }
  return job;
}

const GltfDraco::Decoded* GltfDraco::find(const tinygltf::Primitive& primitive) const {
  const auto found = decoded_.find(&primitive);
  return found == decoded_.end() ? nullptr : &found->second;
}

bool GltfDraco::names(const tinygltf::Primitive& primitive, const std::string& attribute) {
  return draco_id(primitive.extensions.at(kExtension), attribute) >= 0;
}

}  // namespace lsp
