// One file for every rule that only an NTree can break, and one more for the rules of both base structures
// that the cells of an NTree break in a way of their own. full_ntree_scene has nodes 1 to 8 in cells 0 to 7,
// the cells of node 0; the other cells are leaves.
#include <cmath>
#include <limits>

#include "collector.h"

namespace lsp::corpus {
namespace {

using format::RuleId;

void header_and_table(Collector& c) {
  c.ntree_header(RuleId::kMaxStack, "max_stack of an NTree is 97", [](LspHeader& h) { h.max_stack = 97; });
  c.ntree_header(RuleId::kMaxLeaf, "max_leaf_triangles of an NTree is more than there are references",
                 [](LspHeader& h) { h.max_leaf_triangles = h.reference_count + 1; });
  c.ntree_header(RuleId::kRootReference, "the root of an NTree is a leaf",
                 [](LspHeader& h) { h.root = LSP_LEAF_BIT; });
  c.ntree_header(RuleId::kNtreeParameters, "ntree_branching is 17",
                 [](LspHeader& h) { h.ntree_branching = 17; });
  c.ntree_header(RuleId::kAddressable, "reference_count is 2^31",
                 [](LspHeader& h) { h.reference_count = 0x80000000u; });
  c.ntree_header(RuleId::kStepsBound, "max_steps of an NTree is 2^32 - 1",
                 [](LspHeader& h) { h.max_steps = 0xFFFFFFFFu; });
  c.ntree_header(RuleId::kNtreeCube, "ntree_size is NaN", [](LspHeader& h) { h.ntree_size = std::nanf(""); });
  c.ntree_header(RuleId::kNtreeCube, "the bounds reach outside the cube",
                 [](LspHeader& h) { h.ntree_size = 3; });
  c.ntree_header(RuleId::kCountDiffers, "cell_count is one more", [](LspHeader& h) { h.cell_count += 1; });
  c.ntree(RuleId::kMissingSection, "REFS is left out, its count is not zero", [](Image&) {});
  {
    InvalidFile& file = c.files.back();
    Sections sections = to_sections(full_ntree_scene());
    std::erase_if(sections.sections, [](const Section& s) { return s.entry.type == LSP_SECTION_REFS; });
    file.bytes = encode(sections);
  }
  c.ntree(RuleId::kOtherBase, "the file of an NTree has a NODE too", [](Image& i) { i.nodes.push_back({}); });
}

void nodes(Collector& c) {
  c.ntree(RuleId::kChildOutOfRange, "cell 7 names node 9 of 9", [](Image& i) { i.cells[7].child = 9; });
  c.ntree(RuleId::kChildNotAfterParent, "cell 8, of node 1, names node 1", [](Image& i) {
    i.cells[8].child = 1;
    i.cells[8].count = 0;
  });
  c.ntree(RuleId::kTwoParents, "cells 6 and 7 name node 7", [](Image& i) { i.cells[7].child = 7; });
  c.ntree(RuleId::kUnreachable, "cell 7 is a leaf without references, no cell names node 8",
          [](Image& i) { i.cells[7].child = LSP_LEAF_BIT; });
  c.ntree(RuleId::kNotDepthFirst, "cells 6 and 7 change the nodes they name",
          [](Image& i) { std::swap(i.cells[6].child, i.cells[7].child); });
  c.ntree(RuleId::kNodeEmpty, "node 8 has no filled cell", [](Image& i) {
    i.grid[8].bits = 0;
    i.references.resize(i.references.size() - i.cells.back().count);
    i.cells.pop_back();
    i.line_spaces.pop_back();
    i.bit_words.pop_back();
    i.candidates.resize(i.line_spaces.back().candidate_first + (i.line_spaces.back().filled + 3) / 4);
    i.header.max_steps = 3 * 2 * 9 + static_cast<uint32_t>(i.cells.size() + i.references.size());
  });
  c.ntree(RuleId::kGridOffset, "the offset of node 1 counts from its own first cell",
          [](Image& i) { i.grid[1].offset = 0; });
  c.add(RuleId::kGridTail, "bit 27 of a node of 27 cells is set", [] {
    Image image = ntree_scene({.branching = 3, .levels = 1});
    image.grid[0].bits |= 1u << 27;
    image.cells.push_back({LSP_LEAF_BIT | static_cast<uint32_t>(image.references.size()), 1, LSP_NONE});
    image.references.push_back(0);
    image.header.max_steps += 2;
    return encode(image);
  }());
  c.ntree(RuleId::kCellCountWrong, "CELL has one cell more than bits are set", [](Image& i) {
    i.cells.push_back({LSP_LEAF_BIT | static_cast<uint32_t>(i.references.size()), 1, LSP_NONE});
    i.references.push_back(0);
    i.header.max_steps += 2;
  });
  c.ntree(RuleId::kNtreeTooDeep, "ntree_depth is 1, the tree has two levels of nodes",
          [](Image& i) { i.header.ntree_depth = 1; });
  c.ntree(RuleId::kDepthExceeded, "max_depth of an NTree is 1", [](Image& i) { i.header.max_depth = 1; });
  c.ntree(RuleId::kStackExceeded, "max_stack of an NTree is 1", [](Image& i) { i.header.max_stack = 1; });
  c.ntree(RuleId::kStepsExceeded, "max_steps of an NTree is one less than it may take",
          [](Image& i) { i.header.max_steps -= 1; });
}

void cells_and_references(Collector& c) {
  c.ntree(RuleId::kLeafOutOfRange, "the last leaf has a reference more than REFS",
          [](Image& i) { i.cells.back().count += 1; });
  c.ntree(RuleId::kLeafTooLarge, "max_leaf_triangles is 7, a leaf has 8 references",
          [](Image& i) { i.header.max_leaf_triangles = 7; });
  c.ntree(RuleId::kTrianglesUnused, "TRIA and NRML have a triangle more that no leaf holds", [](Image& i) {
    i.triangles.push_back(i.triangles.back());
    i.normals.push_back(i.normals.back());
  });
  c.ntree(RuleId::kChildMissing, "the cell beside a terminal Line Space is none in an exact file",
          [](Image& i) {
            const LspCell last = i.cells.back();
            i.cells.back() = {LSP_NONE, 0, last.line_space};
            i.line_spaces.back().child = LSP_NONE;
            i.references.resize(i.references.size() - last.count);
            i.header.max_steps -= last.count;
          });
  c.ntree(RuleId::kCellEmpty, "a filled cell holds nothing", [](Image& i) {
    i.grid[3].bits |= 1u;
    for (size_t w = 4; w < i.grid.size(); ++w) ++i.grid[w].offset;
    i.cells.insert(i.cells.begin() + i.grid[3].offset, {LSP_NONE, 0, LSP_NONE});
    i.header.max_steps += 1;
  });
  c.ntree(RuleId::kCellReferences, "cell 0 names a node, but its count is 1",
          [](Image& i) { i.cells[0].count = 1; });
  c.ntree(RuleId::kReferencesNotCumulative, "the second leaf begins where the first does",
          [](Image& i) { i.cells[9].child = i.line_spaces[6].child = i.cells[8].child; });
  c.ntree(RuleId::kReferencesUnused, "REFS has a reference more than the leaves hold", [](Image& i) {
    i.references.push_back(0);
    i.header.max_steps += 1;
  });
  c.ntree(RuleId::kReferenceOutOfRange, "the last reference is triangle_count",
          [](Image& i) { i.references.back() = static_cast<uint32_t>(i.triangles.size()); });
  c.ntree(RuleId::kReferenceOrder, "a leaf holds triangle 0 twice", [](Image& i) { i.references[1] = 0; });
}

void line_spaces(Collector& c) {
  c.ntree(RuleId::kLineSpaceOutOfRange, "cell 0 names Line Space line_space_count",
          [](Image& i) { i.cells[0].line_space = static_cast<uint32_t>(i.line_spaces.size()); });
  c.ntree(RuleId::kLineSpaceUsedTwice, "cells 0 and 1 carry Line Space 1",
          [](Image& i) { i.cells[1].line_space = i.cells[0].line_space; });
  c.ntree(RuleId::kLineSpaceUnused, "cell 1 carries no Line Space",
          [](Image& i) { i.cells[1].line_space = LSP_NONE; });
  c.ntree(RuleId::kTerminalBit, "TERMINAL of the last Line Space is clear",
          [](Image& i) { i.cells.back().line_space &= ~LSP_TERMINAL_BIT; });
  c.ntree(RuleId::kLineSpaceOrder, "cells 0 and 1 change their Line Spaces",
          [](Image& i) { std::swap(i.cells[0].line_space, i.cells[1].line_space); });
  c.ntree(RuleId::kLineSpaceChild, "child of Line Space 1 is node 2",
          [](Image& i) { i.line_spaces[1].child = 2; });
  c.ntree(RuleId::kLineSpaceTriangles, "the triangles of the last Line Space reach beyond TRIA",
          [](Image& i) { i.line_spaces.back().triangle_count += 100; });
}

void geometry(Collector& c) {
  c.ntree_geometry(RuleId::kLineSpaceNotAround, "lo.x of the last Line Space is inside its cell",
                   [](Image& i) {
                     LspLineSpace& space = i.line_spaces.back();
                     space.lo.x += 0.5f;
                     space.scale.x = 1.0f / (space.hi.x - space.lo.x);
                   });
  c.ntree_geometry(RuleId::kTriangleOutsideCell, "the last cell holds triangle 2, which is elsewhere",
                   [](Image& i) {
                     i.references.back() = 13;
                     i.references[i.references.size() - 2] = 12;
                     i.references[i.references.size() - 3] = 9;
                     i.references[i.references.size() - 6] = 2;
                   });
  c.ntree_geometry(RuleId::kCellLacksTriangle, "the last leaf lacks its last triangle", [](Image& i) {
    i.references.pop_back();
    i.cells.back().count -= 1;
    i.header.max_steps -= 1;
  });
}

}  // namespace

void break_ntrees(Collector& c) {
  header_and_table(c);
  nodes(c);
  cells_and_references(c);
  line_spaces(c);
  geometry(c);
}

}  // namespace lsp::corpus
