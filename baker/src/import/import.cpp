#include "import/import.h"

#include <xxhash.h>

#include <algorithm>
#include <memory>

#include "import/readers.h"
#include "import/source_file.h"
#include "lsp/file_ending.h"
#include "lsp/program.h"

namespace lsp {

bool is_gltf(const std::filesystem::path& path) {
  const std::string ending = file_ending(path);
  return ending == ".gltf" || ending == ".glb";
}

namespace {

using Reader = void (*)(const std::filesystem::path&, MeshBuilder&);

// What reads files of this name, but glTF; null: none does.
Reader reader_of(const std::filesystem::path& path) {
  const std::string ending = file_ending(path);
  return ending == ".obj"   ? read_obj
         : ending == ".ply" ? read_ply
         : ending == ".stl" ? read_stl
         : ending == ".off" ? read_off
                            : nullptr;
}

}  // namespace

bool is_mesh_name(const std::filesystem::path& path) { return is_gltf(path) || reader_of(path) != nullptr; }

void read_mesh_file(const std::filesystem::path& path, MeshBuilder& builder, PoseRequest& pose) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error))
    throw Failure(Exit::kFile, path.string(), "is a folder, give the mesh files in it");
  if (is_gltf(path)) return read_gltf(path, builder, pose);
  if (const Reader read = reader_of(path)) return read(path, builder);
  throw Failure(Exit::kUnsupported, path.string(),
                "is of no format known here, give .gltf, .glb, .obj, .ply, .stl or .off");
}

void check_pose(const PoseRequest& pose) {
  if (!pose.seconds || pose.met) return;
  if (pose.known.empty()) throw Failure(Exit::kUsage, "", "no input has an animation, leave out --time");
  std::string names;
  for (const std::string& name : pose.known) names += (names.empty() ? "" : ", ") + name;
  throw Failure(Exit::kUsage, "", "no input has the animation " + pose.animation + ", choose of " + names);
}

void refuse_input(const std::filesystem::path& path, uint64_t count, const Rejected& before,
                  const Rejected& after, std::span<const std::string> notes) {
  std::string noted;
  const std::string prefix = path.string() + ": ";
  for (const std::string& note : notes.first(std::min<size_t>(notes.size(), 3)))
    noted += (noted.empty() ? " (noted: " : "; ") + note.substr(note.starts_with(prefix) ? prefix.size() : 0);
  if (!noted.empty()) noted += ")";
  if (count == 0)
    throw Failure(Exit::kInvalid, path.string(), "holds no triangle, give a file with a mesh in it" + noted);
  const std::string why = "none of its " + std::to_string(count) + " triangles can be used (" +
                          std::to_string(after.degenerate - before.degenerate) + " degenerate, " +
                          std::to_string(after.non_finite - before.non_finite) + " not finite, " +
                          std::to_string(after.out_of_range - before.out_of_range) +
                          " with indices out of range, " +
                          std::to_string(after.invisible - before.invisible) + " wholly transparent)";
  throw Failure(Exit::kInvalid, path.string(), why + ", repair or leave out the file" + noted);
}

Mesh import_meshes(std::span<const std::filesystem::path> inputs, const ImportOptions& options) {
  Budget budget(options.memory_limit);
  MeshBuilder builder(budget, options.crease_angle_degrees);
  PoseRequest pose{options.time, options.animation, false, {}};
  for (const std::filesystem::path& path : inputs) {
    builder.begin_input(path);
    const uint64_t count_before = builder.mesh().primitive_count;
    const Rejected before = builder.mesh().rejected;
    const size_t noted = builder.mesh().notes.size();
    try {
      read_mesh_file(path, builder, pose);
    } catch (const std::bad_alloc&) {
      throw Failure(Exit::kLimit, path.string(), "needs more memory to import than there is, split the mesh");
    }
    budget.settle(builder.allocated_bytes());
    const uint64_t count = builder.mesh().primitive_count - count_before;
    const Rejected& rejected = builder.mesh().rejected;
    if (count == rejected.total() - before.total())
      refuse_input(path, count, before, rejected, std::span(builder.mesh().notes).subspan(noted));
  }
  check_pose(pose);
  return builder.take();
}

std::array<uint64_t, 2> hash_sources(const Mesh& mesh) {
  const std::unique_ptr<XXH3_state_t, XXH_errorcode (*)(XXH3_state_t*)> state(XXH3_createState(),
                                                                              XXH3_freeState);
  if (!state) throw std::bad_alloc();
  XXH3_128bits_reset(state.get());
  for (const auto& files : mesh.sources) {
    for (const std::filesystem::path& path : files) {
      std::error_code error;
      if (path != files[0] && !std::filesystem::is_regular_file(path, error)) continue;
      Budget budget(0);
      const std::string bytes = read_file(path, budget);
      XXH3_128bits_update(state.get(), bytes.data(), bytes.size());
    }
  }
  const XXH128_hash_t hash = XXH3_128bits_digest(state.get());
  return {hash.low64, hash.high64};
}

}  // namespace lsp
