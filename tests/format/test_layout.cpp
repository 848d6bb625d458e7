// One layout, three readers: the tables of the specification, the C++ compiler and glslc agree on the name,
// type, offset and size of every field. A row that differs is printed.
#include <gtest/gtest.h>

#include <unistd.h>
#include <array>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include <vector>

#include "fields.h"
#include "line_space.h"
#include "wide.h"

namespace {

using namespace lsp::format;

struct Row {
  std::string offset, size, type, name;
};
struct Table {
  std::string bytes;
  std::vector<Row> rows;
};

std::string trimmed(const std::string& text) {
  const size_t first = text.find_first_not_of(' ');
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(' ') - first + 1);
}

// The tables under headings of the form "### LspNode (64 bytes)".
std::map<std::string, Table> spec_tables() {
  std::ifstream file(std::filesystem::path(LSP_FORMAT_DIR) / "SPEC.md");
  std::map<std::string, Table> tables;
  Table* table = nullptr;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("#")) {
      table = nullptr;
      char name[64], bytes[16];
      if (std::sscanf(line.c_str(), "### %63s (%15s bytes)", name, bytes) == 2) {
        table = &tables[name];
        table->bytes = bytes;
      }
    } else if (table != nullptr && line.starts_with("|")) {
      std::stringstream cells(line.substr(1));
      std::array<std::string, 4> cell;
      for (std::string& text : cell) {
        std::getline(cells, text, '|');
        text = trimmed(text);
      }
      if (cell[0].find_first_not_of("0123456789") == std::string::npos)
        table->rows.push_back({cell[0], cell[1], cell[2], cell[3]});
    }
  }
  return tables;
}

std::string type_text(const Field& field) {
  static constexpr const char* kNames[] = {"u32", "u64", "f32", "vec3"};
  std::string text = kNames[static_cast<int>(field.type)];
  if (field.count() != 1) text += "[" + std::to_string(field.count()) + "]";
  return text;
}

TEST(Layout, TheTablesOfTheSpecificationAreTheHeaders) {
  const std::map<std::string, Table> tables = spec_tables();
  for (const Struct& expected : structs()) {
    const auto found = tables.find(expected.name);
    ASSERT_NE(found, tables.end()) << "SPEC.md has no table of " << expected.name;
    const Table& table = found->second;
    EXPECT_EQ(table.bytes, std::to_string(expected.bytes)) << expected.name;
    ASSERT_EQ(table.rows.size(), expected.fields.size()) << expected.name;
    for (size_t i = 0; i < table.rows.size(); ++i) {
      const Row& row = table.rows[i];
      const Field& field = expected.fields[i];
      const std::string written = row.offset + " " + row.size + " " + row.type + " " + row.name;
      const std::string compiled = std::to_string(field.offset) + " " + std::to_string(field.bytes) + " " +
                                   type_text(field) + " " + field.name;
      EXPECT_EQ(written, compiled) << expected.name << ", row " << i << " of the table in SPEC.md";
    }
  }
  EXPECT_EQ(tables.size(), structs().size());
}

// What a shader's compiler made of a struct: member names and offsets, and the stride of an array of it.
struct ShaderStruct {
  std::map<uint32_t, std::string> names;
  std::map<uint32_t, uint32_t> offsets;
  uint32_t stride = 0;
};

// Reads names and decorations of a SPIR-V module (SPIR-V specification, section 2.3 and 3.32).
std::map<std::string, ShaderStruct> read_module(const std::vector<uint32_t>& words) {
  enum : uint32_t {
    kOpName = 5,
    kOpMemberName = 6,
    kOpTypeRuntimeArray = 29,
    kOpDecorate = 71,
    kOpMemberDecorate = 72
  };
  enum : uint32_t { kArrayStride = 6, kOffset = 35 };
  std::map<uint32_t, std::string> names;
  std::map<uint32_t, ShaderStruct> structs;
  std::map<uint32_t, uint32_t> strides, elements;
  for (size_t at = 5; at < words.size() && words[at] >> 16 != 0; at += words[at] >> 16) {
    const uint32_t* word = &words[at];
    switch (*word & 0xFFFF) {
      case kOpName:
        names[word[1]] = reinterpret_cast<const char*>(word + 2);
        break;
      case kOpMemberName:
        structs[word[1]].names[word[2]] = reinterpret_cast<const char*>(word + 3);
        break;
      case kOpMemberDecorate:
        if (word[3] == kOffset) structs[word[1]].offsets[word[2]] = word[4];
        break;
      case kOpDecorate:
        if (word[2] == kArrayStride) strides[word[1]] = word[3];
        break;
      case kOpTypeRuntimeArray:
        elements[word[1]] = word[2];
        break;
      default:
        break;
    }
  }
  for (const auto& [array, element] : elements) structs[element].stride = strides[array];
  std::map<std::string, ShaderStruct> named;
  for (const auto& [id, shader] : structs)
    if (!shader.offsets.empty()) named[names[id]] = shader;
  return named;
}

TEST(Layout, ShadersHaveTheSameOffsets) {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("lsp-layout-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  std::ofstream shader(folder / "layout.comp");
  shader << "#version 460\n#include \"lsp/layout.h\"\nlayout(local_size_x = 1) in;\n";
  int binding = 0;
  for (const Struct& s : structs())
    shader << "layout(std430, binding = " << binding++ << ") buffer B" << s.name << " { " << s.name << " all_"
           << s.name << "[]; };\n";
  shader << "void main() {\n";
  for (const Struct& s : structs()) shader << "  all_" << s.name << "[1] = all_" << s.name << "[0];\n";
  shader << "}\n";
  shader.close();
  const std::string command = std::string(LSP_GLSLC) + " --target-env=vulkan1.1 -I " + LSP_FORMAT_DIR +
                              "/include -o " + (folder / "layout.spv").string() + " " +
                              (folder / "layout.comp").string();
  ASSERT_EQ(std::system(command.c_str()), 0) << command;
  std::ifstream file(folder / "layout.spv", std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  std::vector<uint32_t> words(bytes.size() / 4);
  std::memcpy(words.data(), bytes.data(), words.size() * 4);
  std::filesystem::remove_all(folder);
  ASSERT_GT(words.size(), 5u);

  const std::map<std::string, ShaderStruct> module = read_module(words);
  for (const Struct& expected : structs()) {
    const auto found = module.find(expected.name);
    ASSERT_NE(found, module.end()) << expected.name << " is not in the shader";
    EXPECT_EQ(found->second.stride, expected.bytes) << expected.name;
    // The header's grid of cells is a struct in it, whose fields are listed by their path.
    std::vector<std::pair<std::string, uint32_t>> members;
    for (const auto& [i, offset] : found->second.offsets) {
      const std::string& name = found->second.names.at(i);
      if (name != "cells" || expected.name != std::string("LspHeader")) {
        members.emplace_back(name, offset);
        continue;
      }
      ASSERT_TRUE(module.contains("LspCellGrid"));
      const ShaderStruct& grid = module.at("LspCellGrid");
      for (const auto& [k, inside] : grid.offsets)
        members.emplace_back("cells." + grid.names.at(k), offset + inside);
    }
    ASSERT_EQ(members.size(), expected.fields.size()) << expected.name;
    for (uint32_t i = 0; i < expected.fields.size(); ++i) {
      EXPECT_EQ(members[i].second, expected.fields[i].offset)
          << expected.name << "." << expected.fields[i].name;
      EXPECT_EQ(members[i].first, expected.fields[i].name) << expected.name;
    }
  }
}

// The worked examples of the specification, by the header's own macros.
TEST(Layout, TheWorkedExamples) {
  EXPECT_EQ(LSP_SHAFT_INDEX(0u, 1u, 1u, 8u, 3u), 17u);
  EXPECT_EQ(LSP_SHAFT_INDEX(1u, 0u, 8u, 1u, 3u), 478u);
  EXPECT_EQ(LSP_SHAFT_INDEX_SYMMETRIC(0u, 1u, 1u, 8u, 3u), 17u);
  EXPECT_EQ(LSP_SHAFT_INDEX(3u, 4u, 7u, 1u, 3u), 1522u);
  const uint32_t bits = 0x184AFC67u, candidates = 0x02030204u;
  EXPECT_EQ(bits >> 5 & 1, 1u);
  const uint32_t entry = static_cast<uint32_t>(__builtin_popcount(bits & 0x1F));
  EXPECT_EQ(100 + (candidates >> entry * 8 & 0xFF), 102u);
  EXPECT_EQ(bits >> 3 & 1, 0u);
  EXPECT_EQ(0x98000007u >> LSP_LEAF_COUNT_SHIFT & LSP_LEAF_COUNT_MASK, 3u);
}

// That of a wide node.
TEST(Layout, TheWorkedExampleOfAWideNode) {
  LspWideNode node{};
  node.lo = {-2, 0, 0};
  node.step = {0.5f, 0, 0};
  node.children[0] = 0x80001800u;
  node.children[1] = 0xFFFFFFFFu;
  node.planes[0] = 0x04FF0300u;
  node.planes[6] = 0x08000804u;
  EXPECT_EQ(wide_child(node, 0) & LSP_WIDE_NODE_BIT, 0u);
  EXPECT_EQ(wide_leaf_count(wide_child(node, 0)), 4u);
  EXPECT_EQ(wide_leaf_first(wide_child(node, 0)), 0u);
  EXPECT_EQ(wide_child(node, 1), LSP_WIDE_NODE_BIT | 0u);
  EXPECT_EQ(wide_child(node, 2), LSP_WIDE_NO_CHILD);
  EXPECT_EQ(wide_box(node, 0).lo[0], -2);
  EXPECT_EQ(wide_box(node, 0).hi[0], 0);
  EXPECT_EQ(wide_box(node, 1).lo[0], -0.5);
  EXPECT_EQ(wide_box(node, 1).hi[0], 2);
  EXPECT_EQ(wide_plane(node, 0, 2), 255u);
  EXPECT_EQ(wide_plane(node, 3, 2), 0u);
}

// "Finding a cell" of an NTree.
TEST(Layout, TheWorkedExampleOfAnNTree) {
  const LspBitWord grid[] = {{0x00002011u, 0}, {0x04000200u, 3}};
  const LspCell cells[] = {{0x80000000u, 2, LSP_NONE},
                           {1, 0, LSP_NONE},
                           {0x80000002u, 1, LSP_NONE},
                           {0x80000003u, 1, LSP_NONE},
                           {0x80000004u, 2, LSP_NONE}};
  const uint32_t references[] = {0, 5, 2, 5, 1, 5};
  const float point[3] = {5.5f, 5.2f, 2.7f};
  uint32_t node = 0, origin[3] = {0, 0, 0};
  const LspCell* cell = nullptr;
  for (float size : {3.0f, 1.0f}) {
    uint32_t at[3];
    for (int axis = 0; axis < 3; ++axis) at[axis] = static_cast<uint32_t>(point[axis] / size);
    const uint32_t index = LSP_CELL_INDEX(at[0] - origin[0], at[1] - origin[1], at[2] - origin[2], 3u);
    EXPECT_EQ(index, size == 3.0f ? 4u : 26u);
    const LspBitWord word = grid[node * LSP_GRID_WORDS(3u) + index / 32];
    ASSERT_EQ(word.bits >> index % 32 & 1, 1u);
    const uint32_t below = word.bits & ((1u << index % 32) - 1);
    cell = &cells[word.offset + static_cast<uint32_t>(__builtin_popcount(below))];
    node = cell->child;
    for (int axis = 0; axis < 3; ++axis) origin[axis] = at[axis] * 3;
  }
  ASSERT_EQ(cell, &cells[4]);
  const uint32_t first = cell->child & ~LSP_LEAF_BIT;
  EXPECT_EQ(references[first], 1u);
  EXPECT_EQ(references[first + 1], 5u);
}

// Every ordered pair of faces and patches has a shaft of its own, and the numbers are dense.
TEST(Layout, ShaftNumbersAreDense) {
  for (uint32_t n : {1u, 2u, 3u}) {
    std::vector<int> seen(30 * n * n * n * n), symmetric(15 * n * n * n * n);
    for (uint32_t in = 0; in < 6; ++in)
      for (uint32_t out = 0; out < 6; ++out)
        for (uint32_t p = 0; in != out && p < n * n; ++p)
          for (uint32_t q = 0; q < n * n; ++q) {
            ++seen.at(LSP_SHAFT_INDEX(in, out, p, q, n));
            if (in < out) ++symmetric.at(LSP_SHAFT_INDEX_SYMMETRIC(in, out, p, q, n));
          }
    for (int count : seen) EXPECT_EQ(count, 1);
    for (int count : symmetric) EXPECT_EQ(count, 1);
    EXPECT_EQ(shape_of(n).shafts, seen.size());
    EXPECT_EQ(shape_of(n | LSP_FORMAT_SYMMETRIC).shafts, symmetric.size());
  }
}

}  // namespace
