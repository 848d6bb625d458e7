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
  tinygltf::Model model;             // without materials, animations, cameras, extras; no buffer data
  nlohmann::json animations;         // as they are, nothing checked
  nlohmann::json looks;              // materials, textures, images and samplers as they are, nothing checked
  std::vector<Bytes> buffers;        // by glTF index; empty where the file gives no bytes for it
  std::vector<std::string> storage;  // what `buffers` points into
  std::vector<std::filesystem::path> sources;  // files beside it that were read
  std::vector<std::string> notes;              // what is not read, or read although it is wrong
};

// Reads and checks a .gltf or .glb file with its external buffers and data URIs.
// The JSON is reduced before tinygltf sees it: what has nothing to do with geometry cannot fail or cost
// anything then (pictures in formats nobody knows, pictures that are missing, deep `extras`).
// Throws Failure: kFile, kInvalid, kUnsupported (version, or a required extension that changes geometry and
// is not known, by name), kLimit.
std::unique_ptr<GltfDocument> read_gltf_document(const std::filesystem::path& path, Budget& budget);

}  // namespace lsp
