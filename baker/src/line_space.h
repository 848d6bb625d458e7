// Line Spaces with representative candidates on chosen nodes of the base structure.
//
// Keul, Koss, Mueller, "Fast Indirect Lighting Approximations using the Representative Candidate Line Space",
// 2018, section 3. The numbering of patches and shafts, and the sparse layout, are in lsp/layout.h.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <vector>

#include "bvh.h"
#include "large_array.h"
#include "lsp/layout.h"

namespace lsp {

enum class LineSpaceKind {
  kCandidates,  // a representative triangle per shaft and direction
  kBinary,  // one bit per shaft, both directions together: enough for visibility. A node with a triangle that
            // is there in part has candidates all the same: a bit does not say which rays pass
};

// Whether a triangle is there in part.
inline bool has_gaps(const LspTriangle& t) { return t.flags >> LSP_TRIANGLE_GAPS_SHIFT != 0; }

struct LineSpaceOptions {
  LineSpaceKind kind = LineSpaceKind::kCandidates;
  uint32_t resolution = 6;             // N: patches along an edge of the box, 1 to LSP_MAX_RESOLUTION
  std::vector<uint32_t> depths = {9};  // D: inner nodes at these depths carry a Line Space (the root is at 0)
  // Rays per shaft that choose its candidate: 1 is the paper's centroid ray, more pick the triangle (or none)
  // whose plane answers all of them best.
  uint32_t samples = 5;
  // Rays can be traced exactly through a node that a Line Space stands for: keep_approximate_only is not
  // asked for.
  bool exact = true;
  // Not empty: words and candidates lie in temporary files in this folder.
  std::filesystem::path folder;
  uint64_t batch_bytes = 64u << 20;  // filled Line Spaces that are held besides, about
  uint32_t triangles = 0;            // T: so does a node above the last depth with fewer triangles than this
};

constexpr size_t kNoSite = SIZE_MAX;
constexpr uint32_t kNoCell = LSP_NONE;

// A node that is to carry a Line Space.
struct LineSpaceSite {
  uint32_t child;     // its child reference
  lsp_float3 lo, hi;  // its box
  // The BVH that knows what is inside: for a node of the BVH its own subtree, for one of an NTree a subtree
  // of a BVH of the same triangles, with its box.
  uint32_t subtree;
  lsp_float3 subtree_lo, subtree_hi;
  // The records that its candidates are numbered within; none: from the first candidate to the last.
  uint32_t triangle_first, triangle_count;
  size_t parent = kNoSite;  // index of the next site above
  uint32_t cell = kNoCell;  // of the NTree
};

struct LineSpaces {
  std::vector<LspLineSpace> records;
  LargeArray<LspBitWord> words;
  LargeArray<uint32_t> candidates;  // entries packed into words
  uint64_t shafts = 0;              // of all Line Spaces
  uint64_t filled = 0;
  uint64_t dense = 0;    // Line Spaces in the dense layout
  uint64_t dropped = 0;  // sites whose Line Space had no filled shaft
};

// Computes the Line Space of every site on all threads of the current oneTBB arena, from the triangles of
// `bvh`, whose records are `triangles`. `references` becomes, per site, its Line Space reference, LSP_NONE
// when no shaft was filled. The result does not depend on the number of threads. `progress` is called with
// the share done, from any thread.
LineSpaces fill_line_spaces(const Bvh& bvh, const LspHeader& header, std::span<const LspTriangle> triangles,
                            const std::vector<LineSpaceSite>& sites, const LineSpaceOptions& options,
                            std::vector<uint32_t>& references,
                            const std::function<void(double)>& progress = {});

}  // namespace lsp
