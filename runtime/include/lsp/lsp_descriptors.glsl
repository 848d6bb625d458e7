/* Of lsp.glsl: the sections of a scene as storage buffers, one a descriptor. */
#ifndef LSP_DESCRIPTORS_GLSL
#define LSP_DESCRIPTORS_GLSL

/* The scene whose buffers are bound. */
struct LspScene {
  uint unused;
};
LspScene lsp_bound_scene() { return LspScene(0u); }

#define LSP_SECTION_BUFFER(number) layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + number) readonly buffer

#if defined(LSP_CELLS)
LSP_SECTION_BUFFER(LSP_BINDING_CELL_WORDS) LspCellWordBuffer { uint lsp_cell_words[]; };
LSP_SECTION_BUFFER(LSP_BINDING_FILLED_CELLS) LspFilledCellBuffer { uvec4 lsp_filled_cell_words[]; };
LSP_SECTION_BUFFER(LSP_BINDING_ENTRIES) LspEntryBuffer { uint lsp_entry_words[]; };
LSP_SECTION_BUFFER(LSP_BINDING_PLANES) LspPlaneBuffer { uvec4 lsp_plane_words[]; };
LSP_SECTION_BUFFER(LSP_BINDING_PLANE_RECORDS) LspPlaneRecordBuffer { uint lsp_plane_records[]; };
LSP_SECTION_BUFFER(LSP_BINDING_SPLITS) LspSplitBuffer { uvec2 lsp_split_words[]; };
LSP_SECTION_BUFFER(LSP_BINDING_CELL_NODES) LspCellNodeBuffer { uvec4 lsp_cell_node_words[]; };
LSP_SECTION_BUFFER(LSP_BINDING_CELL_REFERENCES) LspCellReferenceBuffer { uint lsp_cell_references[]; };
#elif defined(LSP_NTREE)
LSP_SECTION_BUFFER(LSP_BINDING_NODES) LspGridBuffer { uvec2 lsp_grid_words[]; };
LSP_SECTION_BUFFER(LSP_BINDING_CELLS) LspCellBuffer { LspCell lsp_cells[]; };
LSP_SECTION_BUFFER(LSP_BINDING_REFERENCES) LspReferenceBuffer { uint lsp_references[]; };
#elif defined(LSP_WIDE)
LSP_SECTION_BUFFER(LSP_BINDING_NODES) LspWideNodeBuffer { uvec4 lsp_wide_node_words[]; };
#else
LSP_SECTION_BUFFER(LSP_BINDING_NODES) LspNodeBuffer { uvec4 lsp_node_words[]; };
#endif
#if !defined(LSP_CELLS) && !defined(LSP_WIDE)
LSP_SECTION_BUFFER(LSP_BINDING_LINE_SPACES) LspLineSpaceBuffer { uvec4 lsp_line_space_words[]; };
LSP_SECTION_BUFFER(LSP_BINDING_BIT_WORDS) LspBitWordBuffer { uvec2 lsp_bit_words[]; };
LSP_SECTION_BUFFER(LSP_BINDING_CANDIDATES) LspCandidateBuffer { uint lsp_candidate_words[]; };
#endif
LSP_SECTION_BUFFER(LSP_BINDING_TRIANGLES) LspTriangleBuffer { uvec4 lsp_triangle_words[]; };
LSP_SECTION_BUFFER(LSP_BINDING_NORMALS) LspNormalBuffer { LspCornerNormals lsp_corner_normals[]; };

LspTriangle lsp_load_triangle(LspScene scene, uint i) {
  return lsp_triangle_of(lsp_triangle_words[3u * i], lsp_triangle_words[3u * i + 1u], lsp_triangle_words[3u * i + 2u]);
}

LspCornerNormals lsp_load_normals(LspScene scene, uint i) { return lsp_corner_normals[i]; }

#ifdef LSP_CELLS
uint lsp_load_cell_word(LspScene scene, uint i) { return lsp_cell_words[i]; }
uint lsp_load_entry(LspScene scene, uint i) { return lsp_entry_of(lsp_entry_words[i >> 1u], i); }
LspFilledCell lsp_load_cell_origins(LspScene scene, uint i) { return lsp_cell_origins_of(lsp_filled_cell_words[3u * i]); }
LspFilledCell lsp_load_cell_answers(LspScene scene, uint i) {
  return lsp_cell_answers_of(lsp_filled_cell_words[3u * i + 1u]);
}
LspFilledCell lsp_load_cell_tree(LspScene scene, uint i) { return lsp_cell_tree_of(lsp_filled_cell_words[3u * i + 2u]); }
LspPlane lsp_load_plane(LspScene scene, uint i) { return lsp_plane_of(lsp_plane_words[i]); }
uint lsp_load_plane_record(LspScene scene, uint i) { return lsp_plane_records[i]; }
LspSplit lsp_load_split(LspScene scene, uint i) { return lsp_split_of(lsp_split_words[i]); }
LspCellNode lsp_load_cell_node(LspScene scene, uint i) { return lsp_cell_node_of(lsp_cell_node_words[i]); }
uint lsp_load_cell_reference(LspScene scene, uint i) { return lsp_cell_references[i]; }
#elif defined(LSP_WIDE)
LspWideNode lsp_load_wide_node(LspScene scene, uint i) {
  return lsp_wide_node_of(lsp_wide_node_words[6u * i], lsp_wide_node_words[6u * i + 1u], lsp_wide_node_words[6u * i + 2u],
                          lsp_wide_node_words[6u * i + 3u], lsp_wide_node_words[6u * i + 4u],
                          lsp_wide_node_words[6u * i + 5u]);
}
LspWideChild lsp_load_wide_child(LspScene scene, uint i, uint number) {
  return lsp_wide_child_of(lsp_wide_node_words[6u * i].w, lsp_wide_node_words[6u * i + 1u].w,
                           lsp_wide_node_words[6u * i + 2u], number);
}
#else
#ifdef LSP_NTREE
LspBitWord lsp_load_grid(LspScene scene, uint i) {
  uvec2 w = lsp_grid_words[i];
  return LspBitWord(w.x, w.y);
}
LspCell lsp_load_cell(LspScene scene, uint i) { return lsp_cells[i]; }
uint lsp_load_reference(LspScene scene, uint i) { return lsp_references[i]; }
#else
LspNode lsp_load_node(LspScene scene, uint i) {
  return lsp_node_of(lsp_node_words[4u * i], lsp_node_words[4u * i + 1u], lsp_node_words[4u * i + 2u],
                     lsp_node_words[4u * i + 3u]);
}
#endif

LspLineSpace lsp_load_line_space(LspScene scene, uint i) {
  return lsp_line_space_of(lsp_line_space_words[4u * i], lsp_line_space_words[4u * i + 1u],
                           lsp_line_space_words[4u * i + 2u], lsp_line_space_words[4u * i + 3u]);
}

LspBitWord lsp_load_bit_word(LspScene scene, uint i) {
  uvec2 w = lsp_bit_words[i];
  return LspBitWord(w.x, w.y);
}

uint lsp_load_candidate(LspScene scene, uint i) { return lsp_candidate_words[i]; }

#endif

#endif
