/* Of lsp.glsl: the sections of a scene as storage buffers, one a descriptor. */
#ifndef LSP_DESCRIPTORS_GLSL
#define LSP_DESCRIPTORS_GLSL

/* The scene whose buffers are bound. */
struct LspScene {
  uint unused;
};
LspScene lsp_bound_scene() { return LspScene(0u); }

#define LSP_SECTION_BUFFER(number) layout(std430, set = LSP_SET, binding = LSP_FIRST_BINDING + number) readonly buffer

#ifdef LSP_NTREE
LSP_SECTION_BUFFER(LSP_BINDING_NODES) LspGridBuffer { uvec2 lsp_grid_words[]; };
LSP_SECTION_BUFFER(LSP_BINDING_CELLS) LspCellBuffer { LspCell lsp_cells[]; };
LSP_SECTION_BUFFER(LSP_BINDING_REFERENCES) LspReferenceBuffer { uint lsp_references[]; };
#else
LSP_SECTION_BUFFER(LSP_BINDING_NODES) LspNodeBuffer { uvec4 lsp_node_words[]; };
#endif
LSP_SECTION_BUFFER(LSP_BINDING_TRIANGLES) LspTriangleBuffer { uvec4 lsp_triangle_words[]; };
LSP_SECTION_BUFFER(LSP_BINDING_NORMALS) LspNormalBuffer { LspCornerNormals lsp_corner_normals[]; };
LSP_SECTION_BUFFER(LSP_BINDING_LINE_SPACES) LspLineSpaceBuffer { uvec4 lsp_line_space_words[]; };
LSP_SECTION_BUFFER(LSP_BINDING_BIT_WORDS) LspBitWordBuffer { uvec2 lsp_bit_words[]; };
LSP_SECTION_BUFFER(LSP_BINDING_CANDIDATES) LspCandidateBuffer { uint lsp_candidate_words[]; };

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

LspTriangle lsp_load_triangle(LspScene scene, uint i) {
  return lsp_triangle_of(lsp_triangle_words[3u * i], lsp_triangle_words[3u * i + 1u], lsp_triangle_words[3u * i + 2u]);
}

LspCornerNormals lsp_load_normals(LspScene scene, uint i) { return lsp_corner_normals[i]; }

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
