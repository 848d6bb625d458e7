// A part of a bake of cells: what lsp-bake --shard I/K writes and lsp-merge joins.
//
//   PartHeader | LspHeader | settings, JSON | sections, in the order of lsp/sections.def
//
// Each begins at a multiple of 16 bytes. All parts have the tables of their shard's cells; part 1 has the
// rest of the scene besides: the tree, triangles, materials and the grid. A part is read by the version that
// wrote it alone: it lasts from a bake to its merge.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "accuracy.h"
#include "bake.h"
#include "check.h"
#include "shard/shard.h"
#include "writer.h"

namespace lsp {

// What a merge has to know besides the sections; the same of all parts.
struct PartSettings {
  nlohmann::ordered_json meta;  // the provenance, but for the error
  Accuracy accuracy;
  bool exact = true;
  WriteOptions write;
};

constexpr char kPartMagic[8] = {'\x89', 'L', 'S', 'P', 'P', 'A', 'R', 'T'};
constexpr uint32_t kPartVersion = 1;
constexpr uint32_t kMostParts = 1000000;  // of a bake

struct PartHeader {
  char magic[8];
  uint32_t version;
  uint32_t header_bytes;
  char program[32];  // the version of lsp-bake
  uint32_t shard, shards;
  uint64_t file_bytes;
  uint64_t bake_lo, bake_hi;  // hash of the settings and of all that shards have in common
  uint64_t settings_bytes;
  uint64_t reserved;                // zero
  uint64_t counts[format::kKinds];  // elements of each section
  uint64_t hash_lo, hash_hi;        // of the file, where these are zero
};

// A part as it is read. It points into the bytes it was read from.
struct Part {
  std::string file;
  Shard shard;
  uint64_t bake_lo, bake_hi;
  LspHeader header;  // its counters are zero
  PartSettings settings;
  std::string settings_text;
  format::Contents sections;

  template <class T>
  std::span<const T> elements(format::Kind kind) const {
    const std::span<const std::byte> bytes = sections[static_cast<size_t>(kind)];
    return {reinterpret_cast<const T*>(bytes.data()), bytes.size() / sizeof(T)};
  }
};

// Writes the part, whole or not at all; returns its length in bytes. `baked` is one that bake() did not
// finish, with the source's hash; its header loses what it states of tables. Throws Failure with Exit::kFile.
uint64_t write_part(const std::filesystem::path& path, Baked& baked, const Shard& shard,
                    const PartSettings& settings);

// Reads a part of `bytes`, which may be hostile and are 16-byte aligned: all its elements lie within them and
// its hash is right, but nothing is known of what they say. Throws Failure, naming `file`, with
// Exit::kInvalid, or Exit::kUnsupported for a part of another version.
Part read_part(std::span<const std::byte> bytes, const std::string& file);

// The hash that belongs to a part's bytes, low half first.
std::array<uint64_t, 2> part_hash(std::span<const std::byte> bytes);

// The sections of a bake by kind; they point into it.
format::Contents contents_of(const Baked& baked);

// The hash of what shards have in common: a part's settings, the header and, of `sections`, those of the
// scene.
std::array<uint64_t, 2> bake_hash(const std::string& settings, const LspHeader& header,
                                  const format::Contents& sections);

}  // namespace lsp
