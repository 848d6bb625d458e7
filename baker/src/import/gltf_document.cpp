#include "import/gltf_document.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "import/source_file.h"
#include "lsp/program.h"

namespace lsp {
namespace {

using nlohmann::json;

// glTF's own nesting ends at about ten; the bound keeps recursive parsers from using up the stack.
constexpr int kMaxDepth = 64;

[[noreturn]] void fail(const std::string& file, const std::string& what) {
  throw Failure(Exit::kInvalid, file, what + ", export it again");
}

struct Container {
  std::string_view text;  // the JSON
  Bytes binary;           // the BIN chunk, empty where there is none
};

uint32_t word_at(std::string_view bytes, size_t offset) {
  uint32_t value = 0;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

// A GLB is a header of 12 bytes and chunks of 8 + length bytes, JSON first; anything else is taken as JSON.
Container open_container(const std::string& file, std::string_view bytes) {
  if (bytes.substr(0, 4) != "glTF") {
    if (bytes.substr(0, 3) == "\xEF\xBB\xBF") bytes.remove_prefix(3);
    return {bytes, {}};
  }
  if (bytes.size() < 12) fail(file, "is cut short inside its header");
  const uint32_t version = word_at(bytes, 4);
  if (version != 2) {
    throw Failure(Exit::kUnsupported, file,
                  "is binary glTF of version " + std::to_string(version) + ", give version 2");
  }
  Container container;
  bool first = true;
  bytes.remove_prefix(12);
  while (bytes.size() >= 8) {
    const uint32_t length = word_at(bytes, 0), type = word_at(bytes, 4);
    if (length > bytes.size() - 8) fail(file, "is cut short inside a chunk");
    const std::string_view body = bytes.substr(8, length);
    constexpr uint32_t kJson = 0x4E4F534A, kBin = 0x004E4942;
    if (first != (type == kJson)) {
      if (first) fail(file, "does not begin with a JSON chunk");
    } else if (first) {
      container.text = body;
    }
    if (type == kBin && container.binary.empty()) {
      container.binary = {reinterpret_cast<const uint8_t*>(body.data()), body.size()};
    }
    first = false;
    bytes.remove_prefix(8 + length);
  }
  if (first) fail(file, "holds no JSON chunk");
  return container;
}

json parse_json(const std::string& file, std::string_view text, Budget& budget) {
  int depth = 0;
  uint64_t objects = 0, values = 0;
  bool in_string = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') ++i;
      if (c == '"') in_string = false;
    } else if (c == '"') {
      in_string = true;
    } else if (c == '[' || c == '{') {
      ++(c == '{' ? objects : values);
      if (++depth > kMaxDepth) fail(file, "nests its JSON deeper than glTF does");
    } else if (c == ']' || c == '}') {
      --depth;
    } else if (c == ',' || c == ':') {
      ++values;
    }
  }
  // What two documents and tinygltf's structures (half a KB for the two braces of an empty node) take at
  // most.
  budget.charge(file, objects, 1024);
  budget.charge(file, values, 96);
  budget.charge(file, text.size(), 2);
  json document = json::parse(text, nullptr, false);
  if (document.is_discarded()) fail(file, "is not valid JSON");
  if (!document.is_object()) fail(file, "is not a glTF document");
  return document;
}

// The member of an object, or null; never throws whatever `parent` is.
const json& member(const json& parent, const char* key) {
  static const json kNull;
  const auto at = parent.is_object() ? parent.find(key) : parent.end();
  return parent.is_object() && at != parent.end() ? *at : kNull;
}

void copy(const json& from, json& to, std::initializer_list<const char*> keys) {
  for (const char* key : keys) {
    if (!member(from, key).is_null()) to[key] = member(from, key);
  }
}

// Copies members that must be objects or arrays element by element through `reduce`.
template <typename Reduce>
void reduce_list(const json& from, json& to, const char* key, const Reduce& reduce) {
  const json& list = member(from, key);
  if (!list.is_array() || list.empty()) return;
  json& out = to[key] = json::array();
  for (const json& item : list) out.push_back(item.is_object() ? reduce(item) : json::object());
}

json reduce_extensions(const json& item, std::initializer_list<const char*> names) {
  json extensions = json::object();
  copy(member(item, "extensions"), extensions, names);
  return extensions;
}

json reduce_material(const json& item) {
  json out = json::object();
  copy(item, out, {"name", "emissiveFactor", "alphaMode"});
  json pbr = json::object();
  copy(member(item, "pbrMetallicRoughness"), pbr, {"baseColorFactor", "metallicFactor", "roughnessFactor"});
  out["pbrMetallicRoughness"] = std::move(pbr);
  json extensions = json::object();
  const json& all = member(item, "extensions");
  json strength = json::object(), glossiness = json::object();
  copy(member(all, "KHR_materials_emissive_strength"), strength, {"emissiveStrength"});
  copy(member(all, "KHR_materials_pbrSpecularGlossiness"), glossiness, {"diffuseFactor", "glossinessFactor"});
  if (!strength.empty()) extensions["KHR_materials_emissive_strength"] = std::move(strength);
  if (!glossiness.empty()) extensions["KHR_materials_pbrSpecularGlossiness"] = std::move(glossiness);
  if (!extensions.empty()) out["extensions"] = std::move(extensions);
  return out;
}

json reduce_mesh(const json& item) {
  json out = json::object();
  copy(item, out, {"name"});
  out["primitives"] = json::array();
  const json& primitives = member(item, "primitives");
  if (!primitives.is_array()) return out;
  for (const json& primitive : primitives) {
    json reduced = json::object();
    copy(primitive, reduced, {"material", "mode"});
    json attributes = json::object();
    copy(member(primitive, "attributes"), attributes, {"POSITION", "NORMAL"});
    // tinygltf refuses indices without a buffer view, which is what Draco's look like.
    if (!member(primitive, "indices").is_null()) attributes[kGltfIndices] = member(primitive, "indices");
    reduced["attributes"] = std::move(attributes);
    json extensions = reduce_extensions(primitive, {"KHR_draco_mesh_compression"});
    if (!extensions.empty()) reduced["extensions"] = std::move(extensions);
    out["primitives"].push_back(std::move(reduced));
  }
  return out;
}

json reduce_document(const json& from) {
  json to = json::object();
  json asset = json::object();
  copy(member(from, "asset"), asset, {"version", "minVersion"});
  to["asset"] = std::move(asset);
  copy(from, to, {"scene", "extensionsUsed", "extensionsRequired"});
  reduce_list(from, to, "scenes", [](const json& item) {
    json out = json::object();
    copy(item, out, {"nodes"});
    return out;
  });
  reduce_list(from, to, "nodes", [](const json& item) {
    json out = json::object();
    copy(item, out, {"mesh", "children", "matrix", "translation", "rotation", "scale"});
    json extensions = reduce_extensions(item, {"EXT_mesh_gpu_instancing"});
    if (!extensions.empty()) out["extensions"] = std::move(extensions);
    return out;
  });
  reduce_list(from, to, "meshes", reduce_mesh);
  reduce_list(from, to, "materials", reduce_material);
  reduce_list(from, to, "accessors", [](const json& item) {
    json out = json::object();
    copy(item, out, {"bufferView", "byteOffset", "componentType", "normalized", "count", "type", "sparse"});
    return out;
  });
  reduce_list(from, to, "bufferViews", [](const json& item) {
    json out = json::object();
    copy(item, out, {"buffer", "byteOffset", "byteLength", "byteStride"});
    json extensions = reduce_extensions(item, {"EXT_meshopt_compression"});
    if (!extensions.empty()) out["extensions"] = std::move(extensions);
    return out;
  });
  return to;
}

bool is_integer_key(std::string_view key) {
  constexpr std::string_view kKeys[] = {
      "scene",      "nodes",  "children", "mesh",   "indices",     "material",     "mode",
      "POSITION",   "NORMAL", "_INDICES", "buffer", "bufferView",  "byteOffset",   "byteLength",
      "byteStride", "count",  "ROTATION", "SCALE",  "TRANSLATION", "componentType"};
  return std::find(std::begin(kKeys), std::end(kKeys), key) != std::end(kKeys);
}

// JSON has one kind of number, and 36.0 is an index too; tinygltf would take it for missing, and the default
// in its place. Whatever is not a whole number of 0 or more where one belongs is refused here by name.
void make_integers(const std::string& file, std::string_view key, json& value) {
  if (value.is_object()) {
    for (auto& [name, item] : value.items()) make_integers(file, name, item);
  } else if (value.is_array()) {
    for (json& item : value) make_integers(file, key, item);
  } else if (is_integer_key(key) &&
             !(key == "mode" && value.is_string())) {  // EXT_meshopt_compression's is text
    constexpr double kLargest = 9007199254740992.0;    // 2^53: beyond, doubles skip integers
    if (value.is_number_float()) {
      const auto number = value.get<double>();
      if (number >= 0 && number <= kLargest && number == std::floor(number)) value = uint64_t(number);
    }
    if (!value.is_number_unsigned() || value.get<uint64_t>() > uint64_t(kLargest)) {
      fail(file, "has a " + std::string(key) + " that is no index or size");
    }
  }
}

void check_version(const std::string& file, const json& document) {
  const json& version = member(member(document, "asset"), "version");
  const std::string text = version.is_string() ? version.get<std::string>() : "";
  if (text.empty()) fail(file, "names no glTF version");
  if (text.substr(0, 2) != "2.") {
    throw Failure(Exit::kUnsupported, file, "is glTF of version " + printable(text) + ", give version 2");
  }
}

// Extensions that a file may require: those read here, and whole families that change no geometry.
void check_extensions(const std::string& file, const json& document) {
  constexpr std::string_view kRead[] = {"KHR_draco_mesh_compression", "KHR_mesh_quantization",
                                        "EXT_meshopt_compression", "EXT_mesh_gpu_instancing"};
  constexpr std::string_view kWithoutGeometry[] = {"KHR_materials_", "EXT_materials_", "ADOBE_materials_",
                                                   "KHR_texture_",   "EXT_texture_",   "MSFT_texture_",
                                                   "KHR_lights_",    "EXT_lights_",    "KHR_xmp",
                                                   "KHR_audio",      "KHR_techniques_"};
  const json& required = member(document, "extensionsRequired");
  if (!required.is_array()) return;
  for (const json& item : required) {
    const std::string name = item.is_string() ? item.get<std::string>() : "";
    bool known = false;
    for (const std::string_view read : kRead) known = known || name == read;
    for (const std::string_view family : kWithoutGeometry) known = known || name.starts_with(family);
    if (!known) {
      throw Failure(Exit::kUnsupported, file,
                    "requires the extension " + printable(name) + ", export it without that extension");
    }
  }
}

std::string decode_base64(const std::string& file, std::string_view text) {
  std::string out;
  out.reserve(text.size() / 4 * 3);
  uint32_t bits = 0;
  int held = 0;
  for (const char c : text) {
    int value = -1;
    if (c >= 'A' && c <= 'Z') value = c - 'A';
    if (c >= 'a' && c <= 'z') value = c - 'a' + 26;
    if (c >= '0' && c <= '9') value = c - '0' + 52;
    if (c == '+' || c == '-') value = 62;
    if (c == '/' || c == '_') value = 63;
    if (c == '=') break;
    if (value < 0) fail(file, "has a data URI that is not base64");
    bits = bits << 6 | uint32_t(value);
    held += 6;
    if (held >= 8) out += char(bits >> (held -= 8));
  }
  return out;
}

std::string decode_percent(std::string_view text) {
  const auto digit = [](char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
  };
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '%' && i + 2 < text.size() && digit(text[i + 1]) >= 0 && digit(text[i + 2]) >= 0) {
      out += char(digit(text[i + 1]) * 16 + digit(text[i + 2]));
      i += 2;
    } else {
      out += text[i];
    }
  }
  return out;
}

bool is_data_uri(std::string_view uri) { return uri.substr(0, 5) == "data:"; }

std::filesystem::path resolve_uri(const std::filesystem::path& path, const std::string& file,
                                  std::string_view uri) {
  const std::string name = decode_percent(uri);
  if (name.find('\0') != name.npos) fail(file, "names a buffer file with a zero byte in it");
  return path.parent_path() / name;
}

void read_buffers(const std::filesystem::path& path, const json& document, Bytes binary, GltfDocument& out,
                  Budget& budget) {
  const json& list = member(document, "buffers");
  if (!list.is_array()) return;
  out.storage.reserve(out.storage.size() + list.size());  // `buffers` points into it
  for (size_t i = 0; i < list.size(); ++i) {
    const json& length = member(list[i], "byteLength");
    const json& uri = member(list[i], "uri");
    const double declared = length.is_number() ? length.get<double>() : -1.0;
    if (!(declared >= 0 && declared < 1e15)) fail(out.file, "has a buffer without a usable byteLength");
    const auto bytes_wanted = uint64_t(declared);
    Bytes bytes;
    if (uri.is_string()) {
      const auto& text = uri.get_ref<const std::string&>();
      if (is_data_uri(text)) {
        const size_t comma = text.find(',');
        if (comma == text.npos || text.substr(0, comma).find(";base64") == text.npos) {
          fail(out.file, "has a data URI that is not base64");
        }
        budget.charge(out.file, text.size());
        out.storage.push_back(decode_base64(out.file, std::string_view(text).substr(comma + 1)));
      } else {
        out.storage.push_back(read_file(resolve_uri(path, out.file, text), budget));
      }
      bytes = {reinterpret_cast<const uint8_t*>(out.storage.back().data()), out.storage.back().size()};
    } else if (i == 0 && binary.data()) {
      bytes = binary;
    } else {
      // The stand-in for data that only decompression yields; nothing reads it where all its views have that.
      out.buffers.push_back({});
      continue;
    }
    if (bytes.size() < bytes_wanted) {
      fail(out.file, "has buffer " + std::to_string(i) + " declared with " + std::to_string(bytes_wanted) +
                         " bytes and holding " + std::to_string(bytes.size()));
    }
    out.buffers.push_back(bytes.first(bytes_wanted));
  }
}

bool no_image(tinygltf::Image*, const int, std::string*, std::string*, int, int, const unsigned char*, int,
              void*) {
  return true;
}

}  // namespace

std::unique_ptr<GltfDocument> read_gltf_document(const std::filesystem::path& path, Budget& budget) {
  auto out = std::make_unique<GltfDocument>();
  out->file = path.string();
  out->storage.push_back(read_file(path, budget));
  // A string's bytes move with it only where they are short; no document is.
  const std::string& bytes = out->storage.front();
  const Container container = open_container(out->file, bytes);
  if (bytes.size() < 20) fail(out->file, "is too short for a glTF document");
  std::string reduced;
  {
    const json document = parse_json(out->file, container.text, budget);
    check_version(out->file, document);
    check_extensions(out->file, document);
    read_buffers(path, document, container.binary, *out, budget);
    budget.charge(out->file, member(document, "materials").size(), 2 * sizeof(tinygltf::Material));
    json geometry = reduce_document(document);
    make_integers(out->file, "", geometry);
    reduced = geometry.dump(-1, ' ', false, json::error_handler_t::replace);
  }
  if (reduced.size() > 0x7FFFFFFF) fail(out->file, "has more than 2 GiB of JSON");

  tinygltf::TinyGLTF loader;
  loader.SetImageLoader(no_image, nullptr);
  loader.SetFsCallbacks({});  // nothing is left that refers to a file
  std::string error, warning;
  bool good = false;
  try {
    good = loader.LoadASCIIFromString(&out->model, &error, &warning, reduced.data(), unsigned(reduced.size()),
                                      "");
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& problem) {
    error = problem.what();
  }
  if (!good) {
    const std::string reason = printable(error.substr(0, error.find('\n')));
    fail(out->file, "breaks the rules of glTF (" + reason + ")");
  }
  return out;
}

std::vector<std::filesystem::path> external_buffers(const std::filesystem::path& path, Budget& budget) {
  const std::string bytes = read_file(path, budget);
  const std::string file = path.string();
  const json document = parse_json(file, open_container(file, bytes).text, budget);
  std::vector<std::filesystem::path> paths;
  const json& list = member(document, "buffers");
  if (!list.is_array()) return paths;
  for (const json& buffer : list) {
    const json& uri = member(buffer, "uri");
    if (!uri.is_string() || is_data_uri(uri.get_ref<const std::string&>())) continue;
    paths.push_back(resolve_uri(path, file, uri.get_ref<const std::string&>()));
  }
  return paths;
}

}  // namespace lsp
