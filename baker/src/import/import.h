// From mesh files to one Mesh: glTF, GLB, OBJ, PLY, STL and OFF.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include "mesh.h"

namespace lsp {

struct ImportOptions {
  // Upper bound in bytes on what the import may allocate; 0 stands for the machine's physical memory. It is
  // charged before anything is allocated, so a small file that declares a huge scene is refused at once.
  uint64_t memory_limit = 0;
  // Faces of a file without normals share a smooth normal at a corner where they meet at less than this.
  float crease_angle_degrees = 40;
  // glTF scenes are posed at this time, in seconds, of the animation by that name or number (from 0; empty:
  // each file's first). Before its first key and after its last a channel holds what these say. Files without
  // the animation, and all where no time is given, are taken at rest.
  std::optional<double> time = std::nullopt;
  std::string animation = {};
};

// Whether a file of this name is read as a mesh.
bool is_mesh_name(const std::filesystem::path& path);

// Reads the files in order into one mesh in world space (float32, the files' own units and axes).
//
// Numbering: a triangle's primitive is its place in import order, rejected ones counted: inputs in the order
// given; in glTF the default scene's (or, without one, all root) nodes depth first, a mesh's primitives in
// order, instances, strips and fans expanded; elsewhere the file's faces in order, a polygon with n corners
// as its n - 2 triangles (a fan from its first corner where it is convex, ears cut off where it is not).
//
// Winding follows the file; a node that mirrors flips it, so that it still agrees with the normals.
// Normals: the file's where they are usable; elsewhere flat for glTF (as its specification says) and
// angle-weighted within the crease angle over equal positions, and an OBJ's smoothing groups, for the others.
// Positions are welded exactly (-0 equals +0); positions no kept triangle uses are left out.
//
// The files may be hostile: every count, offset and index is checked before use, and memory is bounded.
// Throws Failure: kUsage (no input has the animation asked for), kFile (cannot be read), kInvalid (damaged,
// or a file without any triangle, or without any that can be used), kUnsupported (a format, version or
// required extension, by name), kLimit (memory, or more than 2^32 - 2 triangles).
Mesh import_meshes(std::span<const std::filesystem::path> inputs, const ImportOptions& options);

// The hash that names a mesh's sources: XXH3-128 (seed 0) of the concatenation of the bytes of all of them
// that are there, in order. Returns {low, high} 64 bits. Throws Failure kFile where a file cannot be read.
std::array<uint64_t, 2> hash_sources(const Mesh& mesh);

}  // namespace lsp
