#include "hash.h"

#include <xxhash.h>

#include <cstdio>
#include <new>

namespace lsp::format {
Hasher::Hasher() : state_(XXH3_createState()) {
  if (state_ == nullptr) throw std::bad_alloc();
  XXH3_128bits_reset(static_cast<XXH3_state_t*>(state_.get()));
}

void Hasher::add(const void* bytes, size_t size) {
  XXH3_128bits_update(static_cast<XXH3_state_t*>(state_.get()), bytes, size);
}

Hash128 Hasher::digest() const {
  const XXH128_hash_t hash = XXH3_128bits_digest(static_cast<const XXH3_state_t*>(state_.get()));
  return {hash.low64, hash.high64};
}

void Hasher::Free::operator()(void* state) const { XXH3_freeState(static_cast<XXH3_state_t*>(state)); }

Hash128 hash_bytes(std::span<const std::byte> bytes) {
  const XXH128_hash_t hash = XXH3_128bits(bytes.data(), bytes.size());
  return {hash.low64, hash.high64};
}

Hash128 header_hash(LspHeader header, std::span<const LspSection> table) {
  header.header_hash_lo = 0;
  header.header_hash_hi = 0;
  Hasher hasher;
  hasher.add(&header, sizeof header);
  hasher.add(table.data(), table.size_bytes());
  return hasher.digest();
}

Hash128 content_hash(std::span<const LspSection> table) {
  Hasher hasher;
  for (const LspSection& section : table) {
    hasher.add(&section.type, sizeof section.type);
    hasher.add(&section.element_bytes, sizeof section.element_bytes);
    for (uint64_t value : {section.element_count, section.bytes, section.hash_lo, section.hash_hi})
      hasher.add(&value, sizeof value);
  }
  return hasher.digest();
}

std::string to_hex(Hash128 hash) {
  char text[40];
  std::snprintf(text, sizeof text, "%016llx%016llx", static_cast<unsigned long long>(hash.hi),
                static_cast<unsigned long long>(hash.lo));
  return text;
}

}  // namespace lsp::format
