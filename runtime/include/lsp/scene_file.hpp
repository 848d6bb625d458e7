// A file opened for as long as an object lives: the thin C++ side of lsp.h. Header-only.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <memory>
#include <string>
#include <utility>

#include "lsp/error.hpp"
#include "lsp/lsp.h"

namespace lsp {

// Maps an .lsp file and opens it; a packed file is unpacked into memory first. Errors are thrown as
// lsp::Error with the file's name. The file may be hostile.
class SceneFile {
 public:
  // A packed file whose raw form is larger than `memory_limit` bytes is refused (LSP_ERROR_LIMIT).
  explicit SceneFile(const std::string& path, uint64_t memory_limit = UINT64_MAX) {
    lsp_error error;
    const auto check = [&](lsp_status status) { throw_unless_ok(status, error, path); };
    check(lsp_map_file(path.c_str(), &mapping_.value, &error));
    const lsp_mapping& file = mapping_.value;
    const lsp_status status = lsp_open(file.bytes, file.size, &scene_, &error);
    if (status == LSP_OK) return;
    uint64_t raw = 0;
    lsp_error unpack_error;
    if (status != LSP_ERROR_UNSUPPORTED ||
        lsp_unpacked_size(file.bytes, file.size, &raw, &unpack_error) != LSP_OK) {
      check(status);  // not a packed file, or not a good one: what lsp_open said
    }
    if (raw > memory_limit) {
      throw Error(LSP_ERROR_LIMIT, path,
                  "is packed and needs " + std::to_string(raw) + " bytes of memory, the limit is " +
                      std::to_string(memory_limit) + "; bake it with --compress none");
    }
    // The strictest alignment a device may ask for, so that the unpacked bytes can be imported as a mapping
    // can.
    constexpr uint64_t kImportAlignment = 65536;
    unpacked_.reset(
        std::aligned_alloc(kImportAlignment, (raw + kImportAlignment - 1) & ~(kImportAlignment - 1)));
    if (unpacked_ == nullptr) {
      throw Error(LSP_ERROR_LIMIT, path,
                  "is packed and there is no memory for its " + std::to_string(raw) + " bytes");
    }
    check(lsp_unpack(file.bytes, file.size, unpacked_.get(), raw, &error));
    lsp_unmap_file(&mapping_.value);
    check(lsp_open(unpacked_.get(), raw, &scene_, &error));
  }

  const lsp_scene& scene() const { return scene_; }           // of this file, for as long as it lives
  const LspHeader& header() const { return *scene_.header; }  // of the file
  bool unpacked() const { return unpacked_ != nullptr; }      // the file was packed
  uint64_t bytes_mapped() const { return unpacked() ? 0 : mapping_.value.size; }  // 0 after unpacking

 private:
  struct Mapping {
    lsp_mapping value{};
    Mapping() = default;
    Mapping(Mapping&& other) noexcept : value(std::exchange(other.value, {})) {}
    Mapping& operator=(Mapping&& other) noexcept {
      std::swap(value, other.value);
      return *this;
    }
    ~Mapping() { lsp_unmap_file(&value); }
  };
  struct Free {
    void operator()(void* bytes) const { std::free(bytes); }
  };
  Mapping mapping_;
  std::unique_ptr<void, Free> unpacked_;
  lsp_scene scene_{};
};

}  // namespace lsp
