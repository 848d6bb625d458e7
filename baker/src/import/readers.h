// One reader a format. Each adds one file's triangles to the builder and throws Failure where it cannot.
//
// OBJ, PLY, STL and OFF are read here and not by OpenMesh 9.0's readers, although those are linked by the
// tests as an independent check. Fed with a collecting importer (so that no topology refuses a face), they
// read 242 of 265 sample files right; the others are lost in ways that no clean-up of the text before can
// mend:
//   OBJ  repeated corners are removed from a face, and the face with them where fewer than three are left
//   (320
//        triangles of a bathroom scene vanish uncounted); normals are kept per vertex, the last corner wins;
//        emission, roughness and the names of materials are not handed over; "nan" ends the reading of a
//        vertex
//   PLY  properties of a face behind its list shift everything after it (a file of 1,000 faces gives 528,
//   with
//        290 indices out of range); header lines that end in CR are refused; a list's length is allocated
//        before it is compared with what the file holds
//   STL  triangles with two equal corners are dropped uncounted (56 of 1,368)
//   OFF  comments before the counts, and blank lines, give faces with indices from uninitialised memory; face
//        colours with a leading dot lose the rest of the file (20 faces become 1)
#pragma once

#include <filesystem>

#include "import/gltf_animation.h"
#include "import/instances.h"
#include "import/mesh_builder.h"

namespace lsp {

void read_obj(const std::filesystem::path& path, MeshBuilder& builder);
void read_ply(const std::filesystem::path& path, MeshBuilder& builder);
void read_stl(const std::filesystem::path& path, MeshBuilder& builder);
void read_off(const std::filesystem::path& path, MeshBuilder& builder);
// .gltf and .glb, at rest or in the pose that is asked for.
void read_gltf(const std::filesystem::path& path, MeshBuilder& builder, PoseRequest& pose);
// The same as assets and instances; the builder has the file's notes, materials and what it led to.
void read_gltf_instances(const std::filesystem::path& path, MeshBuilder& builder, PoseRequest& pose,
                         InstancedMeshes& to);

// What import_meshes and import_instances share.
bool is_gltf(const std::filesystem::path& path);
// By the file's extension.
void read_mesh_file(const std::filesystem::path& path, MeshBuilder& builder, PoseRequest& pose);
// Throws Failure kUsage for a time that moves nothing: a mistake.
void check_pose(const PoseRequest& pose);
// Throws Failure kInvalid, saying why nothing can be made of the input's `count` triangles; `notes` are those
// that it led to.
[[noreturn]] void refuse_input(const std::filesystem::path& path, uint64_t count, const Rejected& before,
                               const Rejected& after, std::span<const std::string> notes);

}  // namespace lsp
