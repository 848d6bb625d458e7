#include "import/gltf_document.h"

#include <algorithm>
#include <cstring>

#include "import/gltf_reduce.h"
#include "import/json_member.h"
#include "import/source_file.h"
#include "import/uri.h"
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
// The header's length ends the chunks; one that cuts through a chunk that is whole is wrong and not believed.
Container open_container(const std::string& file, std::string_view bytes, std::vector<std::string>& notes) {
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
  const uint32_t declared = word_at(bytes, 8);
  Container container;
  bool wrong = declared > bytes.size();
  size_t at = 12;
  while (at + 8 <= bytes.size() && (at < declared || wrong || at == 12)) {
    const uint32_t length = word_at(bytes, at), type = word_at(bytes, at + 4);
    if (length > bytes.size() - at - 8) {
      if (wrong && container.binary.data()) break;  // what follows is no chunk
      fail(file, "is cut short inside a chunk");
    }
    const std::string_view body = bytes.substr(at + 8, length);
    constexpr uint32_t kJson = 0x4E4F534A, kBin = 0x004E4942;
    if (at == 12) {
      if (type != kJson) fail(file, "does not begin with a JSON chunk");
      container.text = body;
    } else if (type == kBin && !container.binary.data()) {
      container.binary = {reinterpret_cast<const uint8_t*>(body.data()), body.size()};
    } else {
      const std::string note =
          type == kBin || type == kJson
              ? "it has more chunks of a kind than are read"
              : "chunks of the type " + printable(bytes.substr(at + 4, 4)) + " are not read";
      constexpr size_t kMost = 20;
      if (notes.size() < kMost && std::find(notes.begin(), notes.end(), note) == notes.end())
        notes.push_back(note);
    }
    at += 8 + size_t{length};
    wrong = wrong || at > declared;
  }
  if (!container.text.data()) fail(file, "holds no JSON chunk");
  if (wrong) notes.push_back("its header gives a wrong length, the chunks are read as they are");
  if (at < bytes.size()) {
    notes.push_back(std::to_string(bytes.size() - at) + " bytes after its end are not read");
  }
  return container;
}

json parse_or_fail(const std::string& file, const std::string& text) {
  try {
    return json::parse(text);
  } catch (const json::parse_error& error) {
    fail(file, "is not valid JSON at byte " + std::to_string(error.byte) + " of it");
  } catch (const json::exception&) {  // a number beyond all bounds
    fail(file, "is not valid JSON");
  }
}

// Names that Windows programs have written in the code page of their country are no reason to refuse it.
json parse_json(const std::string& file, std::string_view text, Budget& budget,
                std::vector<std::string>& notes) {
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
  if (document.is_discarded()) {
    budget.charge(file, text.size());
    const std::string repaired = valid_utf8(text);
    if (repaired != text)
      notes.push_back("its text is no valid UTF-8, question marks stand for what is none");
    document = parse_or_fail(file, repaired);
  }
  if (!document.is_object()) fail(file, "is not a glTF document");
  return document;
}

void check_version(const std::string& file, const json& document) {
  const json& version = member(member(document, "asset"), "version");
  const std::string text = version.is_string() ? version.get<std::string>() : "";
  if (text.empty()) fail(file, "names no glTF version");
  if (text.substr(0, 2) != "2.") {
    throw Failure(Exit::kUnsupported, file, "is glTF of version " + printable(text) + ", give version 2");
  }
  const std::string least = text_member(member(document, "asset"), "minVersion");
  if (!least.empty() && least != "2.0") {
    throw Failure(Exit::kUnsupported, file,
                  "asks for a reader of glTF " + printable(least) + ", give version 2.0");
  }
}

// The file by that URI, which from now on is one of the document's sources.
std::filesystem::path resolve_file(const std::filesystem::path& path, const std::string& uri,
                                   GltfDocument& out) {
  std::string remark;
  out.sources.push_back(resolve_uri(path, uri, remark));
  if (!remark.empty()) out.notes.push_back(remark);
  return out.sources.back();
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
        budget.charge(out.file, text.size(), 2);
        out.storage.push_back(decode_data_uri(out.file, text));
      } else {
        out.storage.push_back(read_file(resolve_file(path, text, out), budget));
      }
      bytes = {reinterpret_cast<const uint8_t*>(out.storage.back().data()), out.storage.back().size()};
    } else if (i == 0 && binary.data()) {
      bytes = binary;
    } else {
      // The stand-in for data that only decompression yields; nothing reads it where all its views have that.
      out.buffers.push_back({});
      continue;
    }
    // Writers count padding that they do not write; what reads beyond the end is refused where it reads.
    if (bytes.size() < bytes_wanted) {
      out.notes.push_back("buffer " + std::to_string(i) + " is declared with " +
                          std::to_string(bytes_wanted) + " bytes and holds " + std::to_string(bytes.size()) +
                          ", it is read as it is");
    }
    out.buffers.push_back(bytes.first(std::min<uint64_t>(bytes_wanted, bytes.size())));
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
  const Container container = open_container(out->file, bytes, out->notes);
  if (bytes.size() < 20) fail(out->file, "is too short for a glTF document");
  std::string reduced;
  {
    json document = parse_json(out->file, container.text, budget, out->notes);
    check_version(out->file, document);
    check_required_extensions(out->file, document);
    for (std::string& part : unread_parts(document)) out->notes.push_back(std::move(part));
    read_buffers(path, document, container.binary, *out, budget);
    reduced = reduce_to_geometry(out->file, document).dump(-1, ' ', false, json::error_handler_t::replace);
    if (document.contains("animations")) out->animations = std::move(document["animations"]);
    for (const char* key : {"materials", "textures", "images", "samplers"}) {
      if (document.contains(key)) out->looks[key] = std::move(document[key]);
    }
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

}  // namespace lsp
