// Writes an .lsp file: header, section table, sections (format-spec/SPEC.md).
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "bake.h"
#include "lsp/output_file.h"

namespace lsp {

struct WriteOptions {
  uint32_t alignment = 0;  // 256, 4096 or 65536; 0: 4096, and 256 of a file that is not much longer
  bool zstd = false;       // pack the sections; a packed file cannot be mapped, only unpacked
  int zstd_level = 12;
  uint64_t memory_limit = 0;  // for packing, which holds a section and its packed form; 0: none
};

struct WrittenSection {
  std::string name;
  uint64_t bytes;
  uint64_t stored_bytes;
};

struct Written {
  uint64_t file_bytes;
  std::vector<WrittenSection> sections;
};

// Completes `baked.header` (sizes, offsets, hashes) and writes an OutputFile. `meta` is the provenance, UTF-8
// JSON. Throws Failure with Exit::kFile, or Exit::kLimit.
Written write_lsp(const std::filesystem::path& path, Baked& baked, const std::string& meta,
                  const WriteOptions& options);

// The same into a file that has its name only when it is committed, which is left to the caller.
Written write_lsp(OutputFile& file, Baked& baked, const std::string& meta, const WriteOptions& options);

// How long that file will be, in bytes. Completes `baked.header`, too; packs where `options` say so.
uint64_t lsp_bytes(Baked& baked, const std::string& meta, const WriteOptions& options);

}  // namespace lsp
