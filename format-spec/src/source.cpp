#include "source.h"

#include <lsp/program.h>

#include <cctype>
#include <nlohmann/json.hpp>
#include <string>

#include "file.h"

namespace lsp::format {
namespace {

std::string percent_decoded(const std::string& uri) {
  std::string text;
  for (size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] == '%' && i + 2 < uri.size() && std::isxdigit(static_cast<unsigned char>(uri[i + 1])) &&
        std::isxdigit(static_cast<unsigned char>(uri[i + 2]))) {
      text += static_cast<char>(std::stoi(uri.substr(i + 1, 2), nullptr, 16));
      i += 2;
    } else {
      text += uri[i];
    }
  }
  return text;
}

// The files that the buffers of a .gltf file lie in, data URIs and GLB chunks left out.
std::vector<std::filesystem::path> external_buffers(const std::filesystem::path& gltf,
                                                    std::span<const std::byte> bytes) {
  const auto* text = reinterpret_cast<const char*>(bytes.data());
  const nlohmann::json json = nlohmann::json::parse(text, text + bytes.size(), nullptr, false);
  if (!json.is_object())
    throw Failure(Exit::kInvalid, gltf.string(), "is not JSON: it cannot be the source of a bake");
  std::vector<std::filesystem::path> paths;
  const auto buffers = json.find("buffers");
  if (buffers == json.end() || !buffers->is_array()) return paths;
  for (const nlohmann::json& buffer : *buffers) {
    const auto uri = buffer.is_object() ? buffer.find("uri") : buffer.end();
    if (!buffer.is_object() || uri == buffer.end() || !uri->is_string()) continue;
    const std::string name = uri->get<std::string>();
    if (!name.starts_with("data:")) paths.push_back(gltf.parent_path() / percent_decoded(name));
  }
  return paths;
}

bool is_gltf(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension == ".gltf";
}

}  // namespace

Hash128 hash_sources(std::span<const std::filesystem::path> inputs) {
  Hasher hasher;
  for (const std::filesystem::path& input : inputs) {
    const MappedFile file(input);
    hasher.add(file.bytes().data(), file.bytes().size());
    if (!is_gltf(input)) continue;
    for (const std::filesystem::path& path : external_buffers(input, file.bytes())) {
      const MappedFile buffer(path);
      hasher.add(buffer.bytes().data(), buffer.bytes().size());
    }
  }
  return hasher.digest();
}

}  // namespace lsp::format
