// A glTF asset as far as geometry goes: the JSON reduced to what is read, and the buffers beside it.
#pragma once

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "import/budget.h"
#include "import/tinygltf.h"

namespace lsp {

// Where a primitive's indices are in the reduced model: among its attributes.
inline constexpr const char* kGltfIndices = "_INDICES";

using Bytes = std::span<const uint8_t>;

struct GltfDocument {
  std::string file;
  tinygltf::Model model;       // without images, textures, animations, skins, cameras, extras; no buffer data
  std::vector<Bytes> buffers;  // by glTF index; empty where the file gives no bytes for it
  std::vector<std::string> storage;  // what `buffers` points into
};

// Reads and checks a .gltf or .glb file with its external buffers and data URIs.
// The JSON is reduced before tinygltf sees it: what has nothing to do with geometry cannot fail or cost
// anything then (pictures in formats nobody knows, pictures that are missing, deep `extras`).
// Throws Failure: kFile, kInvalid, kUnsupported (version, or a required extension that changes geometry and
// is not known, by name), kLimit.
std::unique_ptr<GltfDocument> read_gltf_document(const std::filesystem::path& path, Budget& budget);

// The files named by a .gltf file's buffers, in buffer order. For the hash of the sources.
std::vector<std::filesystem::path> external_buffers(const std::filesystem::path& path, Budget& budget);

}  // namespace lsp
