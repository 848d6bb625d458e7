// The hashes of an .lsp file: XXH3-128 with seed 0 everywhere.
#pragma once

#include <lsp/layout.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

namespace lsp::format {

struct Hash128 {
  uint64_t lo = 0;
  uint64_t hi = 0;
  bool operator==(const Hash128&) const = default;
};

// Hashes pieces as if they were one.
class Hasher {
 public:
  Hasher();
  void add(const void* bytes, size_t size);
  Hash128 digest() const;

 private:
  struct Free {
    void operator()(void* state) const;
  };
  std::unique_ptr<void, Free> state_;  // XXH3_state_t
};

Hash128 hash_bytes(std::span<const std::byte> bytes);

// Over the 256 bytes of `header` with header_hash_lo and header_hash_hi zero, then the table's bytes.
Hash128 header_hash(LspHeader header, std::span<const LspSection> table);

// Over type, element_bytes, element_count, bytes, hash_lo, hash_hi of each section (40 bytes each) in table
// order. Offsets, codecs and stored sizes do not enter: the packed and the raw form have the same.
Hash128 content_hash(std::span<const LspSection> table);

// 32 hexadecimal digits, high half first (as xxhsum prints XXH128).
std::string to_hex(Hash128 hash);

}  // namespace lsp::format
