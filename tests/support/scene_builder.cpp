#include "scene_builder.h"

#define XXH_INLINE_ALL
#include <xxhash.h>
#include <zstd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <stdexcept>

namespace lsp::test {
namespace {

struct Box {
  float lo[3] = {INFINITY, INFINITY, INFINITY};
  float hi[3] = {-INFINITY, -INFINITY, -INFINITY};
  void add(const lsp_float3& v) {
    const float p[3] = {v.x, v.y, v.z};
    for (int i = 0; i < 3; ++i) {
      lo[i] = std::min(lo[i], p[i]);
      hi[i] = std::max(hi[i], p[i]);
    }
  }
};

lsp_float3 vector(const float* p) { return {p[0], p[1], p[2]}; }

Box box_of(const LspTriangle* first, size_t count) {
  Box box;
  for (size_t i = 0; i < count; ++i) {
    box.add(first[i].v0);
    box.add(first[i].v1);
    box.add(first[i].v2);
  }
  return box;
}

float centre(const LspTriangle& t, int axis) {
  const float c[3] = {t.v0.x + t.v1.x + t.v2.x, t.v0.y + t.v1.y + t.v2.y, t.v0.z + t.v1.z + t.v2.z};
  return c[axis];
}

// Median splits; reorders parts.triangles into leaf order and writes nodes depth first.
class TreeBuilder {
 public:
  TreeBuilder(Parts& parts, const BuildOptions& options, Random& random)
      : parts_(parts), options_(options), random_(random) {}

  struct Subtree {
    uint32_t child;
    uint32_t line_space;
    Box box;
  };

  Subtree build(uint32_t first, uint32_t count, uint32_t depth) {
    parts_.header.max_depth = std::max(parts_.header.max_depth, depth);
    Subtree result{LSP_NONE, LSP_NONE, box_of(&parts_.triangles[first], count)};
    if (count <= options_.leaf_triangles) {
      result.child = LSP_LEAF_BIT | ((count - 1) << LSP_LEAF_COUNT_SHIFT) | first;
      parts_.header.max_leaf_triangles = std::max(parts_.header.max_leaf_triangles, count);
      ++leaves_;
      return result;
    }
    const bool terminal = depth == options_.line_space_depth;
    if (options_.line_spaces && (terminal || depth == options_.line_space_depth / 2)) {
      result.line_space = add_line_space(result.box, first, count) | (terminal ? LSP_TERMINAL_BIT : 0);
    }
    const auto index = static_cast<uint32_t>(parts_.nodes.size());
    const uint32_t line_space = result.line_space;
    parts_.nodes.emplace_back();
    result.child = index;
    if (line_space != LSP_NONE) parts_.line_spaces[line_space & LSP_LINE_SPACE_MASK].child = index;

    int axis = 0;
    for (int i = 1; i < 3; ++i) {
      if (result.box.hi[i] - result.box.lo[i] > result.box.hi[axis] - result.box.lo[axis]) axis = i;
    }
    const auto begin = parts_.triangles.begin() + first;
    std::sort(begin, begin + count, [&](const LspTriangle& a, const LspTriangle& b) {
      const float ca = centre(a, axis);
      const float cb = centre(b, axis);
      return ca != cb ? ca < cb : a.primitive < b.primitive;
    });
    const Subtree left = build(first, count / 2, depth + 1);
    const Subtree right = build(first + count / 2, count - count / 2, depth + 1);
    parts_.nodes[index] = {vector(left.box.lo),  left.child,  vector(left.box.hi),  left.line_space,
                           vector(right.box.lo), right.child, vector(right.box.hi), right.line_space};
    return result;
  }
  uint32_t leaves() const { return leaves_; }

 private:
  uint32_t add_line_space(const Box& box, uint32_t first, uint32_t count) {
    const uint32_t n = options_.resolution;
    const auto index = static_cast<uint32_t>(parts_.line_spaces.size());
    float margin = 0;
    for (int i = 0; i < 3; ++i) margin = std::max(margin, (box.hi[i] - box.lo[i]) * 1e-3f);
    LspLineSpace ls{};
    float lo[3], hi[3], scale[3];
    for (int i = 0; i < 3; ++i) {
      lo[i] = box.lo[i] - margin;
      hi[i] = box.hi[i] + margin;
      scale[i] = static_cast<float>(n) / (hi[i] - lo[i]);
    }
    ls.lo = vector(lo);
    ls.hi = vector(hi);
    ls.scale = vector(scale);
    ls.word_first = static_cast<uint32_t>(parts_.bit_words.size());
    ls.candidate_first = static_cast<uint32_t>(parts_.candidates.size());
    ls.triangle_first = first;
    ls.triangle_count = count;
    // All layouts in turn: entries of 1, 2 and 4 bytes, dense and sparse.
    const uint32_t entry_bytes = 1u << (index % 3);
    const bool dense = index % 5 == 4;
    ls.format = n | (entry_bytes << LSP_FORMAT_ENTRY_SHIFT) | (dense ? LSP_FORMAT_DENSE : 0);
    const uint32_t shafts = 30 * n * n * n * n;
    std::vector<uint32_t> entries;
    if (!dense) parts_.bit_words.resize(parts_.bit_words.size() + (shafts + 31) / 32);
    for (uint32_t s = 0; s < shafts; ++s) {
      const bool filled = random_.below(2) == 0;
      const uint32_t entry = random_.below(std::min(count, entry_bytes == 1 ? 255u : 65535u));
      if (!dense && s % 32 == 0)
        parts_.bit_words[ls.word_first + s / 32].offset = static_cast<uint32_t>(entries.size());
      if (filled && !dense) parts_.bit_words[ls.word_first + s / 32].bits |= 1u << (s % 32);
      if (filled || dense) entries.push_back(filled ? entry : LSP_NONE);
      ls.filled += filled ? 1 : 0;
    }
    std::vector<unsigned char> packed(((entries.size() * entry_bytes) + 3) / 4 * 4);
    for (size_t i = 0; i < entries.size(); ++i) memcpy(&packed[i * entry_bytes], &entries[i], entry_bytes);
    parts_.candidates.resize(ls.candidate_first + packed.size() / 4);
    memcpy(&parts_.candidates[ls.candidate_first], packed.data(), packed.size());
    parts_.line_spaces.push_back(ls);
    return index;
  }

  Parts& parts_;
  const BuildOptions& options_;
  Random& random_;
  uint32_t leaves_ = 0;
};

uint32_t octahedral(float x, float y, float z) {
  const float sum = std::fabs(x) + std::fabs(y) + std::fabs(z);
  float u = x / sum;
  float v = y / sum;
  if (z < 0) {
    const float w = (1 - std::fabs(v)) * (u >= 0 ? 1.0f : -1.0f);
    v = (1 - std::fabs(u)) * (v >= 0 ? 1.0f : -1.0f);
    u = w;
  }
  const auto pack = [](float f) {
    return static_cast<uint32_t>(static_cast<uint16_t>(static_cast<int16_t>(std::lround(f * 32767.0f))));
  };
  return pack(u) | (pack(v) << 16);
}

// Header fields that follow from the sections.
void complete(Parts& parts, const BuildOptions& options, uint32_t leaves) {
  LspHeader& h = parts.header;
  h.magic_0 = LSP_MAGIC_0;
  h.magic_1 = LSP_MAGIC_1;
  h.version_major = LSP_VERSION_MAJOR;
  h.version_minor = lsp_version_minor(h.required_features);
  h.header_bytes = sizeof(LspHeader);
  h.section_table_offset = sizeof(LspHeader);
  h.alignment = options.alignment;
  h.base_structure = LSP_BASE_BVH;
  h.primitive_count = parts.triangles.size();
  h.normal_angle_cos = -0.5f;
  h.plane_tolerance = 0.05f;
  format::set_counters(h, parts);
  h.max_stack = h.max_depth + 1;
  h.max_steps = h.node_count + leaves + 1;
  h.resolution = parts.line_spaces.empty() ? 0 : options.resolution;
  h.required_features = (options.exact ? LSP_FEATURE_EXACT : 0) |
                        (parts.line_spaces.empty() ? 0 : LSP_FEATURE_LINE_SPACES) |
                        (parts.normals.empty() ? 0 : LSP_FEATURE_NORMALS) |
                        (parts.materials.empty() ? 0 : LSP_FEATURE_MATERIALS);
}

void build_tree(Parts& parts, const BuildOptions& options, Random& random) {
  TreeBuilder builder(parts, options, random);
  const auto count = static_cast<uint32_t>(parts.triangles.size());
  parts.header.root = LSP_NONE;
  parts.header.root_line_space = LSP_NONE;
  if (count != 0) {
    const TreeBuilder::Subtree root = builder.build(0, count, 0);
    parts.header.root = root.child;
    parts.header.root_line_space = root.line_space;
    parts.header.bounds_min = vector(root.box.lo);
    parts.header.bounds_max = vector(root.box.hi);
  }
  if (options.normals) {
    for (uint32_t i = 0; i < count; ++i) {
      const auto normal = [&] {
        return octahedral(random.between(-1, 1), random.between(-1, 1), random.between(0.1f, 1));
      };
      parts.normals.push_back({normal(), normal(), normal()});
      parts.triangles[i].flags = i % 3 == 0 ? 0 : LSP_TRIANGLE_SMOOTH;
    }
  }
  if (options.materials) parts.materials.push_back({{0.8f, 0.8f, 0.8f}, 1, {0, 0, 0}, 1, 0, {}});
  complete(parts, options, builder.leaves());
}

uint64_t round_up(uint64_t value, uint64_t alignment) {
  return (value + alignment - 1) / alignment * alignment;
}

Bytes write(const Parts& parts, bool packed) {
  struct Source {
    const format::KindInfo& known;
    const void* data;
    size_t count;
  };
  const Source sources[] = {
#define LSP_ARRAY_SECTION(Name, TYPE, code, Element, flag, base, feature, owed, member, ...) \
  {info(format::Kind::k##Name), parts.member.data(), parts.member.size()},
#define LSP_BYTE_SECTION(Name, ...) {info(format::Kind::k##Name), parts.meta.data(), parts.meta.size()},
#include "lsp/sections.def"
  };
  LspHeader header = parts.header;
  std::vector<LspSection> table;
  std::vector<std::string> stored;
  for (const Source& s : sources) {
    if (s.count == 0) continue;
    const format::KindInfo& known = s.known;
    const uint32_t flags = known.flag == format::SectionFlag::kRequired ? LSP_SECTION_REQUIRED : 0;
    const size_t bytes = s.count * known.element_bytes;
    const XXH128_hash_t hash = XXH3_128bits(s.data, bytes);
    std::string content(static_cast<const char*>(s.data), bytes);
    const bool pack = packed && known.type != LSP_SECTION_META;
    if (pack) {
      std::string frame(ZSTD_compressBound(bytes), '\0');
      const size_t size = ZSTD_compress(frame.data(), frame.size(), s.data, bytes, 3);
      if (ZSTD_isError(size) != 0) throw std::runtime_error("zstd failed");
      frame.resize(size);
      content = frame;
    }
    table.push_back({known.type, flags, 0, content.size(), bytes, pack ? LSP_CODEC_ZSTD : LSP_CODEC_NONE,
                     known.element_bytes, s.count, hash.low64, hash.high64});
    stored.push_back(std::move(content));
  }
  header.section_count = static_cast<uint32_t>(table.size());
  const uint64_t alignment = packed ? 256 : header.alignment;
  uint64_t end = sizeof(LspHeader) + table.size() * sizeof(LspSection);
  for (LspSection& section : table) {
    section.offset = round_up(end, alignment);
    end = section.offset + section.stored_bytes;
  }
  header.file_bytes = round_up(end, alignment);
  XXH3_state_t content_hash;
  XXH3_128bits_reset(&content_hash);
  for (const LspSection& s : table) {
    XXH3_128bits_update(&content_hash, &s.type, 4);
    XXH3_128bits_update(&content_hash, &s.element_bytes, 4);
    XXH3_128bits_update(&content_hash, &s.element_count, 8);
    XXH3_128bits_update(&content_hash, &s.bytes, 8);
    XXH3_128bits_update(&content_hash, &s.hash_lo, 16);
  }
  const XXH128_hash_t hash = XXH3_128bits_digest(&content_hash);
  header.content_hash_lo = hash.low64;
  header.content_hash_hi = hash.high64;
  Bytes bytes(header.file_bytes);
  memcpy(bytes.data(), &header, sizeof header);
  memcpy(bytes.data() + sizeof header, table.data(), table.size() * sizeof(LspSection));
  for (size_t i = 0; i < table.size(); ++i)
    memcpy(bytes.data() + table[i].offset, stored[i].data(), stored[i].size());
  repair_header_hash(bytes);
  return bytes;
}

}  // namespace

uint32_t Random::next() {
  const uint64_t old = state_;
  state_ = old * 6364136223846793005ull + 1442695040888963407ull;
  const auto xored = static_cast<uint32_t>(((old >> 18) ^ old) >> 27);
  const auto rotation = static_cast<uint32_t>(old >> 59);
  return (xored >> rotation) | (xored << ((32 - rotation) & 31));
}

Parts build_parts(const BuildOptions& options) {
  Random random(options.seed);
  Parts parts;
  for (uint32_t i = 0; i < options.triangles; ++i) {
    const float c[3] = {random.between(-1, 1), random.between(-1, 1), random.between(-1, 1)};
    lsp_float3 v[3];
    for (lsp_float3& p : v) {
      p = {c[0] + random.between(-0.2f, 0.2f), c[1] + random.between(-0.2f, 0.2f),
           c[2] + random.between(-0.2f, 0.2f)};
      if (i % 4 == 1) p.x = std::round(c[0] * 4) / 4;  // in a plane of the axis: boxes without thickness
      if (i % 4 == 2) p.y = std::round(c[1] * 4) / 4;
      if (i % 4 == 3) p.z = std::round(c[2] * 4) / 4;
    }
    for (lsp_float3& p : v) p = {p.x * options.scale, p.y * options.scale, p.z * options.scale};
    parts.triangles.push_back({v[0], i, v[1], 0, v[2], 0});
  }
  build_tree(parts, options, random);
  return parts;
}

Parts build_stack_of_sheets(uint32_t triangles, uint32_t leaf_triangles) {
  BuildOptions options;
  options.line_spaces = options.normals = options.materials = false;
  options.leaf_triangles = leaf_triangles;
  Random random(7);
  Parts parts;
  for (uint32_t i = 0; i < triangles; ++i) {
    // The axis passes through the triangle's box, close by its hypotenuse.
    const float x = static_cast<float>(i);
    const float shift = i + 1 == triangles ? -0.5f : 0.0f;
    parts.triangles.push_back({{x, -1, -0.9f + shift}, i, {x, 0.9f, 1 + shift}, 0, {x, -1, 1 + shift}, 0});
  }
  build_tree(parts, options, random);
  return parts;
}

Bytes write_raw(const Parts& parts) { return write(parts, false); }
Bytes write_packed(const Parts& parts) { return write(parts, true); }

void repair_header_hash(Bytes& bytes) {
  LspHeader& header = header_of(bytes);
  header.header_hash_lo = 0;
  header.header_hash_hi = 0;
  const XXH128_hash_t hash =
      XXH3_128bits(bytes.data(), sizeof(LspHeader) + size_t{header.section_count} * sizeof(LspSection));
  header.header_hash_lo = hash.low64;
  header.header_hash_hi = hash.high64;
}

LspSection& section_of(Bytes& bytes, uint32_t type) {
  for (uint32_t i = 0; i < header_of(bytes).section_count; ++i) {
    if (sections_of(bytes)[i].type == type) return sections_of(bytes)[i];
  }
  throw std::runtime_error("no such section");
}

}  // namespace lsp::test
