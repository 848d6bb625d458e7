/* Of lsp.glsl with LSP_ADDRESSES defined: the sections of a scene through buffer device addresses, for scenes with one
 * larger than the device's maxStorageBufferRange; addresses have no such limit (and were about half as fast on
 * lavapipe). The including shader needs besides
 *
 *   #extension GL_EXT_buffer_reference : require
 *   #extension GL_EXT_buffer_reference_uvec2 : require
 *
 * Binding +0 is the header as without; +1 is a storage buffer of eleven 64-bit addresses, those of the sections
 * of bindings +1 to +11 there (lsp_vulkan_address_table writes it). Nothing else differs.
 *
 * No robustBufferAccess watches over addresses, so every index is checked against the header's counts here,
 * which lsp_open has checked against the file: a bad index reads zeros, as on the CPU.
 */
#ifndef LSP_ADDRESSES_GLSL
#define LSP_ADDRESSES_GLSL

layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer LspWords4 { uvec4 at[]; };
layout(buffer_reference, std430, buffer_reference_align = 8) readonly buffer LspWords2 { uvec2 at[]; };
layout(buffer_reference, std430, buffer_reference_align = 4) readonly buffer LspWords { uint at[]; };

/* Where the sections of a scene are. */
struct LspSections {
  uvec2 nodes; /* of an NTree: GRID; with LSP_WIDE: WNOD */
  uvec2 triangles;
  uvec2 normals;
  uvec2 line_spaces;
  uvec2 bit_words;
  uvec2 candidates;
  uvec2 cells;
  uvec2 references;
  uvec2 filled_cells; /* of cells, as the next; there splits, planes, entries and cell words come before */
  uvec2 plane_records;
  uvec2 cell_nodes;
};

#ifdef LSP_INSTANCES
/* lsp_vulkan_asset of lsp/lsp_vulkan.h. */
struct LspAsset {
  LspSections sections;
  uint dial;
  uint reserved;
  LspHeader header;
};
layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + LSP_BINDING_ASSETS) readonly buffer LspAssetBuffer {
  LspAsset lsp_assets[];
};
/* An asset, by its number. */
struct LspScene {
  LspSections at;
  uint asset;
};
#define LSP_HEADER(scene) lsp_assets[(scene).asset].header
#else
layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + LSP_BINDING_NODES) readonly buffer LspAddressBuffer {
  LspSections lsp_addresses;
};
/* The scene whose table is bound. */
struct LspScene {
  LspSections at;
};
LspScene lsp_bound_scene() { return LspScene(lsp_addresses); }
#define LSP_HEADER(scene) lsp_header
#endif

LspTriangle lsp_load_triangle(LspScene scene, uint i) {
  if (i >= LSP_HEADER(scene).triangle_count) return lsp_triangle_of(uvec4(0u), uvec4(0u), uvec4(0u));
  LspWords4 words = LspWords4(scene.at.triangles);
  return lsp_triangle_of(words.at[3u * i], words.at[3u * i + 1u], words.at[3u * i + 2u]);
}

LspCornerNormals lsp_load_normals(LspScene scene, uint i) {
  if (i >= LSP_HEADER(scene).triangle_count) return LspCornerNormals(0u, 0u, 0u);
  LspWords words = LspWords(scene.at.normals);
  return LspCornerNormals(words.at[3u * i], words.at[3u * i + 1u], words.at[3u * i + 2u]);
}

#ifdef LSP_CELLS
uint lsp_load_cell_word(LspScene scene, uint i) {
  LspCellGrid grid = LSP_HEADER(scene).cells;
  return i < grid.cells_x * grid.cells_y * grid.cells_z ? LspWords(scene.at.cells).at[i] : 0u;
}
uint lsp_load_entry(LspScene scene, uint i) {
  return (i >> 1u) < LSP_HEADER(scene).entry_word_count ? lsp_entry_of(LspWords(scene.at.candidates).at[i >> 1u], i) : 0u;
}
uvec4 lsp_load_filled_cell(LspScene scene, uint i, uint part) {
  return i < LSP_HEADER(scene).filled_cell_count ? LspWords4(scene.at.filled_cells).at[3u * i + part] : uvec4(0u);
}
LspFilledCell lsp_load_cell_origins(LspScene scene, uint i) { return lsp_cell_origins_of(lsp_load_filled_cell(scene, i, 0u)); }
LspFilledCell lsp_load_cell_answers(LspScene scene, uint i) { return lsp_cell_answers_of(lsp_load_filled_cell(scene, i, 1u)); }
LspFilledCell lsp_load_cell_tree(LspScene scene, uint i) { return lsp_cell_tree_of(lsp_load_filled_cell(scene, i, 2u)); }
LspPlane lsp_load_plane(LspScene scene, uint i) {
  return lsp_plane_of(i < LSP_HEADER(scene).plane_count ? LspWords4(scene.at.bit_words).at[i] : uvec4(0u));
}
uint lsp_load_plane_record(LspScene scene, uint i) {
  return i < LSP_HEADER(scene).plane_count ? LspWords(scene.at.plane_records).at[i] : 0u;
}
LspSplit lsp_load_split(LspScene scene, uint i) {
  return lsp_split_of(i < LSP_HEADER(scene).split_count ? LspWords2(scene.at.line_spaces).at[i] : uvec2(0u));
}
LspCellNode lsp_load_cell_node(LspScene scene, uint i) {
  return lsp_cell_node_of(i < LSP_HEADER(scene).cell_node_count ? LspWords4(scene.at.cell_nodes).at[i] : uvec4(0u));
}
uint lsp_load_cell_reference(LspScene scene, uint i) {
  return i < LSP_HEADER(scene).cell_reference_count ? LspWords(scene.at.references).at[i] : 0u;
}
#endif
#ifdef LSP_WIDE
LspWideNode lsp_load_wide_node(LspScene scene, uint i) {
  if (i >= LSP_HEADER(scene).wide_node_count)
    return lsp_wide_node_of(uvec4(0u), uvec4(0u), uvec4(0u), uvec4(0u), uvec4(0u), uvec4(0u));
  LspWords4 words = LspWords4(scene.at.nodes);
  return lsp_wide_node_of(words.at[6u * i], words.at[6u * i + 1u], words.at[6u * i + 2u], words.at[6u * i + 3u],
                          words.at[6u * i + 4u], words.at[6u * i + 5u]);
}
LspWideChild lsp_load_wide_child(LspScene scene, uint i, uint number) {
  if (i >= LSP_HEADER(scene).wide_node_count) return LspWideChild(0u, 0u, 0u);
  LspWords4 words = LspWords4(scene.at.nodes);
  return lsp_wide_child_of(words.at[6u * i].w, words.at[6u * i + 1u].w, words.at[6u * i + 2u], number);
}
#endif
#if !defined(LSP_CELLS) && !defined(LSP_WIDE)
#ifdef LSP_NTREE
LspBitWord lsp_load_grid(LspScene scene, uint i) {
  uint count = LSP_HEADER(scene).node_count * LSP_GRID_WORDS(LSP_HEADER(scene).ntree_branching);
  if (i >= count) return LspBitWord(0u, 0u);
  uvec2 w = LspWords2(scene.at.nodes).at[i];
  return LspBitWord(w.x, w.y);
}

LspCell lsp_load_cell(LspScene scene, uint i) {
  if (i >= LSP_HEADER(scene).cell_count) return LspCell(0u, 0u, 0u);
  LspWords words = LspWords(scene.at.cells);
  return LspCell(words.at[3u * i], words.at[3u * i + 1u], words.at[3u * i + 2u]);
}

uint lsp_load_reference(LspScene scene, uint i) {
  return i < LSP_HEADER(scene).reference_count ? LspWords(scene.at.references).at[i] : 0u;
}
#else
LspNode lsp_load_node(LspScene scene, uint i) {
  if (i >= LSP_HEADER(scene).node_count) return lsp_node_of(uvec4(0u), uvec4(0u), uvec4(0u), uvec4(0u));
  LspWords4 words = LspWords4(scene.at.nodes);
  return lsp_node_of(words.at[4u * i], words.at[4u * i + 1u], words.at[4u * i + 2u], words.at[4u * i + 3u]);
}
#endif

LspLineSpace lsp_load_line_space(LspScene scene, uint i) {
  if (i >= LSP_HEADER(scene).line_space_count) return lsp_line_space_of(uvec4(0u), uvec4(0u), uvec4(0u), uvec4(0u));
  LspWords4 words = LspWords4(scene.at.line_spaces);
  return lsp_line_space_of(words.at[4u * i], words.at[4u * i + 1u], words.at[4u * i + 2u], words.at[4u * i + 3u]);
}

LspBitWord lsp_load_bit_word(LspScene scene, uint i) {
  if (i >= LSP_HEADER(scene).bit_word_count) return LspBitWord(0u, 0u);
  uvec2 w = LspWords2(scene.at.bit_words).at[i];
  return LspBitWord(w.x, w.y);
}

uint lsp_load_candidate(LspScene scene, uint i) {
  return i < LSP_HEADER(scene).candidate_word_count ? LspWords(scene.at.candidates).at[i] : 0u;
}

#endif

#endif
