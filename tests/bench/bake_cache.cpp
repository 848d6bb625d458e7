#include "bake_cache.h"

#include <xxhash.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <memory>

#include "lsp/output_file.h"
#include "lsp/program.h"

namespace lsp::bench {
namespace {

namespace fs = std::filesystem;

class Hash {
 public:
  Hash() : state_(XXH3_createState(), XXH3_freeState) { XXH3_128bits_reset(state_.get()); }
  void add(const std::string& text) {
    XXH3_128bits_update(state_.get(), text.data(), text.size() + 1);  // the zero keeps "a", "b" from "ab"
  }
  void add_file(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    if (!file) throw Failure(Exit::kFile, path.string(), "cannot be read");
    std::vector<char> piece(1 << 20);
    while (file) {
      file.read(piece.data(), static_cast<std::streamsize>(piece.size()));
      XXH3_128bits_update(state_.get(), piece.data(), static_cast<size_t>(file.gcount()));
    }
  }
  std::string text() const {
    const XXH128_hash_t hash = XXH3_128bits_digest(state_.get());
    char digits[40];
    std::snprintf(digits, sizeof digits, "%016llx%016llx", static_cast<unsigned long long>(hash.high64),
                  static_cast<unsigned long long>(hash.low64));
    return digits;
  }

 private:
  std::unique_ptr<XXH3_state_t, XXH_errorcode (*)(XXH3_state_t*)> state_;
};

fs::path record_of(const fs::path& bake) { return bake.string() + ".json"; }

}  // namespace

std::string bake_key(const fs::path& program, const fs::path& input,
                     const std::vector<std::string>& options) {
  Hash hash;
  hash.add_file(program);
  hash.add_file(input);
  for (const std::string& option : options) hash.add(option);
  if (input.extension() == ".obj" || input.extension() == ".gltf") {
    std::vector<std::string> beside;
    const fs::path folder = input.has_parent_path() ? input.parent_path() : fs::path(".");
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
      if (!entry.is_regular_file()) continue;
      beside.push_back(entry.path().filename().string() + " " + std::to_string(entry.file_size()) + " " +
                       std::to_string(entry.last_write_time().time_since_epoch().count()));
    }
    std::sort(beside.begin(), beside.end());
    for (const std::string& file : beside) hash.add(file);
  }
  return hash.text();
}

Json find_bake(const fs::path& bake, const std::string& key) {
  std::ifstream file(record_of(bake));
  if (!file) return nullptr;
  const Json record = Json::parse(file, nullptr, false);
  std::error_code error;
  const uint64_t bytes = fs::file_size(bake, error);
  if (error || !record.is_object() || record.value("key", "") != key ||
      record.value("file_bytes", uint64_t{0}) != bytes) {
    return nullptr;
  }
  return record;
}

void remember_bake(const fs::path& bake, const std::string& key, Json record) {
  record["key"] = key;
  record["file_bytes"] = fs::file_size(bake);
  write_file(record_of(bake), record.dump(1) + "\n");
}

}  // namespace lsp::bench
