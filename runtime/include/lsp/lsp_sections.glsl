/* Of lsp.glsl: the sections of a scene, and how each of their elements is read. They are storage buffers, one a
 * descriptor; of assets of instances (LSP_INSTANCES) those of all lie in one buffer, the pool. With LSP_ADDRESSES defined
 * either are reached through buffer device addresses: for scenes with a section, for assets that are together larger than
 * the device's maxStorageBufferRange; addresses have no such limit, and 0.4 of the speed on lavapipe. The including
 * shader needs besides then
 *
 *   #extension GL_EXT_buffer_reference : require
 *   #extension GL_EXT_buffer_reference_uvec2 : require
 *
 * Binding +0 is the header as without; +1 is a storage buffer of eleven 64-bit addresses, those of the sections
 * of bindings +1 to +11 there (lsp_vulkan_address_table writes it). Nothing else differs. Of instances the pool is not
 * bound.
 *
 * No robustBufferAccess watches over addresses, so every index is checked against the header's counts here,
 * which lsp_open has checked against the file: a bad index reads zeros, as on the CPU.
 */
#ifndef LSP_SECTIONS_GLSL
#define LSP_SECTIONS_GLSL

/* LSP_SECTION(binding, Buffer, Element, array) declares a section's buffer, where there are descriptors of each.
 * LSP_AT(scene, words, array, member, i) is element i: of `array`, or of the `words` at LspSections.member.
 * LSP_BEYOND(i, count): whether element i is not there and would be read all the same. */
#if defined(LSP_ADDRESSES) || defined(LSP_INSTANCES)
/* Where the sections of a scene are: addresses, or in the low word the place in the pool, in units of 16 bytes. */
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
#define LSP_SECTION(number, Buffer, Element, array)
#define LSP_AT(scene, words, array, member, i) words((scene).at.member, i)
#endif

#ifdef LSP_ADDRESSES
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer LspWords4 { uvec4 at[]; };
layout(buffer_reference, std430, buffer_reference_align = 8) readonly buffer LspWords2 { uvec2 at[]; };
layout(buffer_reference, std430, buffer_reference_align = 4) readonly buffer LspWords { uint at[]; };
layout(buffer_reference, std430, buffer_reference_align = 4) readonly buffer LspNormalArray { LspCornerNormals at[]; };
layout(buffer_reference, std430, buffer_reference_align = 4) readonly buffer LspCellArray { LspCell at[]; };
#define lsp_words4(place, i) LspWords4(place).at[i]
#define lsp_words2(place, i) LspWords2(place).at[i]
#define lsp_words1(place, i) LspWords(place).at[i]
#define lsp_normals_at(place, i) LspNormalArray(place).at[i]
#define lsp_cells_at(place, i) LspCellArray(place).at[i]
#define LSP_BEYOND(i, count) ((i) >= (count))
#else
#define LSP_BEYOND(i, count) false
#endif

#if defined(LSP_INSTANCES) && !defined(LSP_ADDRESSES)
/* The pool, three times: a load of elements as they are is faster than one of parts of larger ones. */
layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + LSP_BINDING_POOL) readonly buffer LspPool4 { uvec4 lsp_pool4[]; };
layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + LSP_BINDING_POOL + 1) readonly buffer LspPool2 { uvec2 lsp_pool2[]; };
layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + LSP_BINDING_POOL + 2) readonly buffer LspPool1 { uint lsp_pool1[]; };
uvec4 lsp_words4(uvec2 place, uint i) { return lsp_pool4[place.x + i]; }
uvec2 lsp_words2(uvec2 place, uint i) { return lsp_pool2[2u * place.x + i]; }
uint lsp_words1(uvec2 place, uint i) { return lsp_pool1[4u * place.x + i]; }
LspCornerNormals lsp_normals_at(uvec2 place, uint i) {
  uint first = 4u * place.x + 3u * i;
  return LspCornerNormals(lsp_pool1[first], lsp_pool1[first + 1u], lsp_pool1[first + 2u]);
}
#endif

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
  LspHeader header;
};
#define LSP_HEADER(scene) (scene).header
#elif defined(LSP_ADDRESSES)
layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + LSP_BINDING_NODES) readonly buffer LspAddressBuffer {
  LspSections lsp_addresses;
};
/* The scene whose table is bound. */
struct LspScene {
  LspSections at;
};
LspScene lsp_bound_scene() { return LspScene(lsp_addresses); }
#define LSP_HEADER(scene) lsp_header
#else
/* The scene whose buffers are bound. */
struct LspScene {
  uint unused;
};
LspScene lsp_bound_scene() { return LspScene(0u); }
#define LSP_HEADER(scene) lsp_header
#define LSP_SECTION(number, Buffer, Element, array) \
  layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + number) readonly buffer Buffer { Element array[]; };
#define LSP_AT(scene, words, array, member, i) array[i]
#endif

LSP_SECTION(LSP_BINDING_TRIANGLES, LspTriangleBuffer, uvec4, lsp_triangle_words)
#define LSP_TRIANGLES(scene, i) LSP_AT(scene, lsp_words4, lsp_triangle_words, triangles, i)
LspTriangle lsp_load_triangle(LspScene scene, uint i) {
  if (LSP_BEYOND(i, LSP_HEADER(scene).triangle_count)) return lsp_triangle_of(uvec4(0u), uvec4(0u), uvec4(0u));
  return lsp_triangle_of(LSP_TRIANGLES(scene, 3u * i), LSP_TRIANGLES(scene, 3u * i + 1u),
                         LSP_TRIANGLES(scene, 3u * i + 2u));
}

LSP_SECTION(LSP_BINDING_NORMALS, LspNormalBuffer, LspCornerNormals, lsp_corner_normals)
LspCornerNormals lsp_load_normals(LspScene scene, uint i) {
  if (LSP_BEYOND(i, LSP_HEADER(scene).triangle_count)) return LspCornerNormals(0u, 0u, 0u);
  return LSP_AT(scene, lsp_normals_at, lsp_corner_normals, normals, i);
}

#ifdef LSP_CELLS
LSP_SECTION(LSP_BINDING_CELL_WORDS, LspCellWordBuffer, uint, lsp_cell_words)
uint lsp_load_cell_word(LspScene scene, uint i) {
  LspCellGrid grid = LSP_HEADER(scene).cells;
  return LSP_BEYOND(i, grid.cells_x * grid.cells_y * grid.cells_z) ? 0u
         : LSP_AT(scene, lsp_words1, lsp_cell_words, cells, i);
}

LSP_SECTION(LSP_BINDING_ENTRIES, LspEntryBuffer, uint, lsp_entry_words)
uint lsp_load_entry(LspScene scene, uint i) {
  return LSP_BEYOND(i >> 1u, LSP_HEADER(scene).entry_word_count) ? 0u
         : lsp_entry_of(LSP_AT(scene, lsp_words1, lsp_entry_words, candidates, i >> 1u), i);
}

LSP_SECTION(LSP_BINDING_FILLED_CELLS, LspFilledCellBuffer, uvec4, lsp_filled_cell_words)
uvec4 lsp_load_filled_cell(LspScene scene, uint i, uint part) {
  return LSP_BEYOND(i, LSP_HEADER(scene).filled_cell_count) ? uvec4(0u)
         : LSP_AT(scene, lsp_words4, lsp_filled_cell_words, filled_cells, 3u * i + part);
}
LspFilledCell lsp_load_cell_origins(LspScene scene, uint i) { return lsp_cell_origins_of(lsp_load_filled_cell(scene, i, 0u)); }
LspFilledCell lsp_load_cell_answers(LspScene scene, uint i) { return lsp_cell_answers_of(lsp_load_filled_cell(scene, i, 1u)); }
LspFilledCell lsp_load_cell_tree(LspScene scene, uint i) { return lsp_cell_tree_of(lsp_load_filled_cell(scene, i, 2u)); }

LSP_SECTION(LSP_BINDING_PLANES, LspPlaneBuffer, uvec4, lsp_plane_words)
LspPlane lsp_load_plane(LspScene scene, uint i) {
  return LSP_BEYOND(i, LSP_HEADER(scene).plane_count) ? lsp_plane_of(uvec4(0u))
         : lsp_plane_of(LSP_AT(scene, lsp_words4, lsp_plane_words, bit_words, i));
}

LSP_SECTION(LSP_BINDING_PLANE_RECORDS, LspPlaneRecordBuffer, uint, lsp_plane_records)
uint lsp_load_plane_record(LspScene scene, uint i) {
  return LSP_BEYOND(i, LSP_HEADER(scene).plane_count) ? 0u : LSP_AT(scene, lsp_words1, lsp_plane_records, plane_records, i);
}

LSP_SECTION(LSP_BINDING_SPLITS, LspSplitBuffer, uvec2, lsp_split_words)
LspSplit lsp_load_split(LspScene scene, uint i) {
  return LSP_BEYOND(i, LSP_HEADER(scene).split_count) ? lsp_split_of(uvec2(0u))
         : lsp_split_of(LSP_AT(scene, lsp_words2, lsp_split_words, line_spaces, i));
}

LSP_SECTION(LSP_BINDING_CELL_NODES, LspCellNodeBuffer, uvec4, lsp_cell_node_words)
LspCellNode lsp_load_cell_node(LspScene scene, uint i) {
  return LSP_BEYOND(i, LSP_HEADER(scene).cell_node_count) ? lsp_cell_node_of(uvec4(0u))
         : lsp_cell_node_of(LSP_AT(scene, lsp_words4, lsp_cell_node_words, cell_nodes, i));
}

LSP_SECTION(LSP_BINDING_CELL_REFERENCES, LspCellReferenceBuffer, uint, lsp_cell_references)
uint lsp_load_cell_reference(LspScene scene, uint i) {
  return LSP_BEYOND(i, LSP_HEADER(scene).cell_reference_count) ? 0u
         : LSP_AT(scene, lsp_words1, lsp_cell_references, references, i);
}
#endif

#ifdef LSP_WIDE
LSP_SECTION(LSP_BINDING_NODES, LspWideNodeBuffer, uvec4, lsp_wide_node_words)
#define LSP_WIDE_NODES(scene, i) LSP_AT(scene, lsp_words4, lsp_wide_node_words, nodes, i)
LspWideNode lsp_load_wide_node(LspScene scene, uint i) {
  if (LSP_BEYOND(i, LSP_HEADER(scene).wide_node_count))
    return lsp_wide_node_of(uvec4(0u), uvec4(0u), uvec4(0u), uvec4(0u), uvec4(0u), uvec4(0u));
  return lsp_wide_node_of(LSP_WIDE_NODES(scene, 6u * i), LSP_WIDE_NODES(scene, 6u * i + 1u),
                          LSP_WIDE_NODES(scene, 6u * i + 2u), LSP_WIDE_NODES(scene, 6u * i + 3u),
                          LSP_WIDE_NODES(scene, 6u * i + 4u), LSP_WIDE_NODES(scene, 6u * i + 5u));
}
LspWideChild lsp_load_wide_child(LspScene scene, uint i, uint number) {
  if (LSP_BEYOND(i, LSP_HEADER(scene).wide_node_count)) return LspWideChild(0u, 0u, 0u);
  return lsp_wide_child_of(LSP_WIDE_NODES(scene, 6u * i).w, LSP_WIDE_NODES(scene, 6u * i + 1u).w,
                           LSP_WIDE_NODES(scene, 6u * i + 2u), number);
}
#endif

#if !defined(LSP_CELLS) && !defined(LSP_WIDE)
#ifdef LSP_NTREE
LSP_SECTION(LSP_BINDING_NODES, LspGridBuffer, uvec2, lsp_grid_words)
LspBitWord lsp_load_grid(LspScene scene, uint i) {
  if (LSP_BEYOND(i, LSP_HEADER(scene).node_count * LSP_GRID_WORDS(LSP_HEADER(scene).ntree_branching)))
    return LspBitWord(0u, 0u);
  uvec2 w = LSP_AT(scene, lsp_words2, lsp_grid_words, nodes, i);
  return LspBitWord(w.x, w.y);
}

LSP_SECTION(LSP_BINDING_CELLS, LspCellBuffer, LspCell, lsp_cells)
LspCell lsp_load_cell(LspScene scene, uint i) {
  if (LSP_BEYOND(i, LSP_HEADER(scene).cell_count)) return LspCell(0u, 0u, 0u);
  return LSP_AT(scene, lsp_cells_at, lsp_cells, cells, i);
}

LSP_SECTION(LSP_BINDING_REFERENCES, LspReferenceBuffer, uint, lsp_references)
uint lsp_load_reference(LspScene scene, uint i) {
  return LSP_BEYOND(i, LSP_HEADER(scene).reference_count) ? 0u : LSP_AT(scene, lsp_words1, lsp_references, references, i);
}
#else
LSP_SECTION(LSP_BINDING_NODES, LspNodeBuffer, uvec4, lsp_node_words)
#define LSP_NODES(scene, i) LSP_AT(scene, lsp_words4, lsp_node_words, nodes, i)
LspNode lsp_load_node(LspScene scene, uint i) {
  if (LSP_BEYOND(i, LSP_HEADER(scene).node_count)) return lsp_node_of(uvec4(0u), uvec4(0u), uvec4(0u), uvec4(0u));
  return lsp_node_of(LSP_NODES(scene, 4u * i), LSP_NODES(scene, 4u * i + 1u), LSP_NODES(scene, 4u * i + 2u),
                     LSP_NODES(scene, 4u * i + 3u));
}
#endif

LSP_SECTION(LSP_BINDING_LINE_SPACES, LspLineSpaceBuffer, uvec4, lsp_line_space_words)
#define LSP_LINE_SPACES(scene, i) LSP_AT(scene, lsp_words4, lsp_line_space_words, line_spaces, i)
LspLineSpace lsp_load_line_space(LspScene scene, uint i) {
  if (LSP_BEYOND(i, LSP_HEADER(scene).line_space_count))
    return lsp_line_space_of(uvec4(0u), uvec4(0u), uvec4(0u), uvec4(0u));
  return lsp_line_space_of(LSP_LINE_SPACES(scene, 4u * i), LSP_LINE_SPACES(scene, 4u * i + 1u),
                           LSP_LINE_SPACES(scene, 4u * i + 2u), LSP_LINE_SPACES(scene, 4u * i + 3u));
}

LSP_SECTION(LSP_BINDING_BIT_WORDS, LspBitWordBuffer, uvec2, lsp_bit_words)
LspBitWord lsp_load_bit_word(LspScene scene, uint i) {
  if (LSP_BEYOND(i, LSP_HEADER(scene).bit_word_count)) return LspBitWord(0u, 0u);
  uvec2 w = LSP_AT(scene, lsp_words2, lsp_bit_words, bit_words, i);
  return LspBitWord(w.x, w.y);
}

LSP_SECTION(LSP_BINDING_CANDIDATES, LspCandidateBuffer, uint, lsp_candidate_words)
uint lsp_load_candidate(LspScene scene, uint i) {
  return LSP_BEYOND(i, LSP_HEADER(scene).candidate_word_count) ? 0u
         : LSP_AT(scene, lsp_words1, lsp_candidate_words, candidates, i);
}
#endif

#endif
