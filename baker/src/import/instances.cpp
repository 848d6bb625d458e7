#include "import/instances.h"

#include <utility>

#include "import/readers.h"
#include "import/rounding.h"
#include "import/source_file.h"
#include "lsp/program.h"

namespace lsp {
namespace {

void add(Rejected& to, const Rejected& more) {
  to.degenerate += more.degenerate;
  to.non_finite += more.non_finite;
  to.out_of_range += more.out_of_range;
  to.collapsed += more.collapsed;
  to.invisible += more.invisible;
}

// Each asset's positions are about an origin, and so is the scene: the transforms take both into them while
// they are in double precision.
void settle_origins(InstancedMeshes& scene) {
  constexpr size_t kMostLooked = 64;  // positions of an instance
  for (InstancedAsset& asset : scene.assets) asset.origin = std::exchange(asset.mesh.origin, glm::dvec3(0));
  OriginChooser chooser;
  for (MeshInstance& instance : scene.instances) {
    const InstancedAsset& asset = scene.assets[instance.asset];
    instance.transform[3] = instance.transform * glm::dvec4(asset.origin, 1);
    const std::vector<glm::vec3>& positions = asset.mesh.positions;
    const size_t step = (positions.size() + kMostLooked - 1) / kMostLooked;
    for (size_t i = 0; i < positions.size(); i += step)
      chooser.add(glm::dvec3(instance.transform * glm::dvec4(positions[i], 1)));
  }
  scene.origin = chooser.origin();
  for (MeshInstance& instance : scene.instances) instance.transform[3] -= glm::dvec4(scene.origin, 0);
}

// One input's meshes and instances; its files and notes are left in the builder.
void read_input(const std::filesystem::path& path, MeshBuilder& builder, PoseRequest& pose,
                InstancedMeshes& to) {
  if (is_gltf(path)) return read_gltf_instances(path, builder, pose, to);
  read_mesh_file(path, builder, pose);
  to.sources.back() = builder.mesh().sources.back();
  const uint32_t asset = add_asset(to, builder, path.stem().string(), false);
  if (asset != kNoIndex) to.instances.push_back({asset, glm::dmat4(1), ""});
}

}  // namespace

uint32_t add_asset(InstancedMeshes& to, MeshBuilder& builder, const std::string& name, bool is_part) {
  to.allocated_bytes += builder.allocated_bytes();
  InstancedAsset asset{printable(name), to.sources.size() - 1, is_part, builder.take(), {}};
  to.primitive_count += asset.mesh.primitive_count;
  add(to.rejected, asset.mesh.rejected);
  for (std::string& note : asset.mesh.notes) {
    if (is_part) note = "mesh " + asset.name + ": " + note;
    to.notes.push_back(note);
  }
  if (asset.mesh.triangles.empty()) return kNoIndex;
  to.assets.push_back(std::move(asset));
  return uint32_t(to.assets.size() - 1);
}

InstancedMeshes import_instances(std::span<const std::filesystem::path> inputs,
                                 const ImportOptions& options) {
  Budget budget(options.memory_limit);
  PoseRequest pose{options.time, options.animation, false, {}};
  InstancedMeshes scene;
  for (const std::filesystem::path& path : inputs) {
    MeshBuilder builder(budget, options.crease_angle_degrees);
    builder.begin_input(path);
    scene.sources.push_back({path});
    const uint64_t count_before = scene.primitive_count;
    const Rejected before = scene.rejected;
    const size_t first = scene.assets.size(), noted = scene.notes.size();
    try {
      read_input(path, builder, pose, scene);
    } catch (const std::bad_alloc&) {
      throw Failure(Exit::kLimit, path.string(), "needs more memory to import than there is, split the mesh");
    }
    budget.settle(scene.allocated_bytes);
    if (scene.assets.size() == first)
      refuse_input(path, scene.primitive_count - count_before, before, scene.rejected,
                   std::span(scene.notes).subspan(noted));
  }
  check_pose(pose);
  for (InstancedAsset& asset : scene.assets) asset.mesh.sources = {scene.sources[asset.input]};
  settle_origins(scene);
  return scene;
}

}  // namespace lsp
