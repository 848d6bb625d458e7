/* Traversal of wide nodes, for exact rays, in the common subset of GLSL 4.6 and C++20; lsp/traverse.h includes it where
 * LSP_WIDE is defined. Layout: LspWideNode in layout.h.
 *
 * What a node leaves to visit is a group: the node, and the numbers of its children that are hit, in order. One entry
 * of the stack holds one group, so that a ray writes to memory at most once a node (Ylitie, Karras, Laine, "Efficient
 * Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", 2017, section 4). Closest rays take the children by
 * distance, any-hit rays in the order of the file.
 *
 * runtime/src/trace_wide_lanes.cpp walks the same nodes, a node's eight boxes side by side. What a ray hits depends on
 * neither: see lsp_triangle.
 *
 * Rounding, as at the top of lsp/traverse.h: a plane lo + q * step is off by u (3 R + max|o|), which its slab adds to,
 * and a corner's depth: 11 u R + 2 u max|o| in all, where a box is grown by 16 u R + 4 u max|o|.
 */

/* Groups to be visited later: the node, its children (as LspWalk.rest), and a distance that none of them is nearer
 * than. Entry 0 of the first is LSP_NONE once all work is done, see lsp/bvh.h. */
uint lsp_stack_ref[LSP_STACK_SIZE];
uint lsp_stack_rest[LSP_STACK_SIZE];
float lsp_stack_t[LSP_STACK_SIZE];

/* How far the ray has come. */
struct LspWalk {
  LspBest best;
  uint ref;  /* a node that is to be visited, or a leaf that was found; LSP_NONE: neither */
  uint node; /* of the group that the ray is in */
  uint rest; /* its children to come, three bits each, the next lowest; their number from bit 24 on */
  float t;   /* none of them is nearer */
  uint top;  /* of the stack */
  uint step;
  LspCounts counts;
};
LspWalk lsp_walk;

/* Where the ray enters a child of a node whose planes have these bytes: a key to order by, distance above, number in
 * the lowest three bits; LSP_NONE: it does not. */
LSP_FN uint lsp_wide_key(LspSetup s, LspQuery q, LspWideNode node, vec3 lo, vec3 hi, float best_t, uint number) {
  vec3 corner = lsp_vec3(node.lo);
  vec3 step = lsp_vec3(node.step);
  precise vec3 box_lo = corner + step * lo;
  precise vec3 box_hi = corner + step * hi;
  float t = lsp_box(s, box_lo, box_hi, best_t);
  uint distance = (q.flags & LSP_TRACE_ANY_HIT) != 0u ? 0u : floatBitsToUint(lsp_max(0.0f, t)) & ~7u;
  return t <= best_t && lo.x <= hi.x ? distance | number : LSP_NONE; /* inside out: there is no child */
}

LSP_FN float lsp_wide_byte(uint word, uint shift) { return float((word >> shift) & 0xFFu); }

/* Of the smaller and the larger of two keys. */
LSP_FN uvec2 lsp_wide_ordered(uint a, uint b) { return a < b ? uvec2(a, b) : uvec2(b, a); }

/* Of children whose bytes are in words k of every plane's pair. */
#define LSP_WIDE_KEY(k, shift, number)                                                                               \
  lsp_wide_key(s, q, node,                                                                                           \
               vec3(lsp_wide_byte(node.planes[k], shift), lsp_wide_byte(node.planes[2 + k], shift),                  \
                    lsp_wide_byte(node.planes[4 + k], shift)),                                                       \
               vec3(lsp_wide_byte(node.planes[6 + k], shift), lsp_wide_byte(node.planes[8 + k], shift),              \
                    lsp_wide_byte(node.planes[10 + k], shift)),                                                      \
               best_t, number)
/* A comparison of a sorting network. */
#define LSP_WIDE_SORT(a, b)           \
  pair = lsp_wide_ordered(a, b);      \
  a = pair.x;                         \
  b = pair.y

/* The children of a node that the ray hits up to best_t, as LspWalk.rest, and where the second is entered at the
 * earliest. */
struct LspWideHits {
  uint rest;
  float second_t;
};

LSP_FN LspWideHits lsp_wide_hits(LspSetup s, LspQuery q, LspWideNode node, float best_t) {
  uint k0 = LSP_WIDE_KEY(0, 0u, 0u);
  uint k1 = LSP_WIDE_KEY(0, 8u, 1u);
  uint k2 = LSP_WIDE_KEY(0, 16u, 2u);
  uint k3 = LSP_WIDE_KEY(0, 24u, 3u);
  uint k4 = LSP_WIDE_KEY(1, 0u, 4u);
  uint k5 = LSP_WIDE_KEY(1, 8u, 5u);
  uint k6 = LSP_WIDE_KEY(1, 16u, 6u);
  uint k7 = LSP_WIDE_KEY(1, 24u, 7u);
  uint count = (k0 != LSP_NONE ? 1u : 0u) + (k1 != LSP_NONE ? 1u : 0u) + (k2 != LSP_NONE ? 1u : 0u) +
               (k3 != LSP_NONE ? 1u : 0u) + (k4 != LSP_NONE ? 1u : 0u) + (k5 != LSP_NONE ? 1u : 0u) +
               (k6 != LSP_NONE ? 1u : 0u) + (k7 != LSP_NONE ? 1u : 0u);
  /* Of 19 comparisons, the fewest that sort eight (Knuth, "The Art of Computer Programming", volume 3, 5.3.4). */
  uvec2 pair;
  LSP_WIDE_SORT(k0, k2);
  LSP_WIDE_SORT(k1, k3);
  LSP_WIDE_SORT(k4, k6);
  LSP_WIDE_SORT(k5, k7);
  LSP_WIDE_SORT(k0, k4);
  LSP_WIDE_SORT(k1, k5);
  LSP_WIDE_SORT(k2, k6);
  LSP_WIDE_SORT(k3, k7);
  LSP_WIDE_SORT(k0, k1);
  LSP_WIDE_SORT(k2, k3);
  LSP_WIDE_SORT(k4, k5);
  LSP_WIDE_SORT(k6, k7);
  LSP_WIDE_SORT(k2, k4);
  LSP_WIDE_SORT(k3, k5);
  LSP_WIDE_SORT(k1, k4);
  LSP_WIDE_SORT(k3, k6);
  LSP_WIDE_SORT(k1, k2);
  LSP_WIDE_SORT(k3, k4);
  LSP_WIDE_SORT(k5, k6);
  LspWideHits hits;
  hits.rest = (k0 & 7u) | (k1 & 7u) << 3u | (k2 & 7u) << 6u | (k3 & 7u) << 9u | (k4 & 7u) << 12u | (k5 & 7u) << 15u |
              (k6 & 7u) << 18u | (k7 & 7u) << 21u | count << 24u;
  hits.second_t = count > 1u ? uintBitsToFloat(k1 & ~7u) : 0.0f;
  return hits;
}
#undef LSP_WIDE_KEY
#undef LSP_WIDE_SORT

/* Whether nothing of a group is to be visited any more. Keys know no negative distance. */
LSP_FN bool lsp_wide_over(uint rest, float t, float best_t) {
  return rest < (1u << 24u) || t > lsp_max(0.0f, best_t);
}

/* No ray is treated apart. */
LSP_FN bool lsp_is_far(LspScene, LspSetup) { return false; }

/* To the root; LSP_NONE: the ray is answered already. */
LSP_STEP void lsp_begin(LspScene scene, LspSetup s, LspQuery) {
  lsp_walk.best = lsp_no_best(s);
  lsp_walk.node = 0u;
  lsp_walk.rest = 0u;
  lsp_walk.t = 0.0f;
  lsp_walk.top = 0u;
  lsp_walk.step = 0u;
  lsp_walk.counts = lsp_no_counts();
  vec3 lo = lsp_vec3(lsp_load_header(scene).bounds_min);
  vec3 hi = lsp_vec3(lsp_load_header(scene).bounds_max);
  bool enters = lsp_load_header(scene).wide_node_count != 0u && lsp_box(s, lo, hi, s.tmax) <= s.tmax;
  lsp_walk.ref = enters ? 0u : LSP_NONE;
  lsp_stack_ref[0] = lsp_walk.ref;
}

/* Down to the next leaf; LSP_NONE: there is none. */
LSP_STEP void lsp_advance(LspScene scene, LspSetup s, LspQuery q) {
  bool found = (q.flags & LSP_TRACE_ANY_HIT) != 0u && lsp_walk.best.triangle != LSP_NONE;
  float best_t = lsp_walk.best.t;
  uint most = lsp_load_header(scene).max_steps;
  uint step = lsp_walk.step;
  uint top = found ? 0u : lsp_walk.top;
  uint visit = found ? LSP_NONE : lsp_walk.ref;
  uint node = lsp_walk.node;
  uint rest = found ? 0u : lsp_walk.rest;
  float t = lsp_walk.t;
  uint leaf = LSP_NONE;
  bool cut = false;
  bool going = true;
  while (going) {
    cut = visit != LSP_NONE && step >= most;
    if (visit != LSP_NONE && !cut) {
      LspWideHits hits = lsp_wide_hits(s, q, lsp_load_wide_node(scene, visit), best_t);
      node = visit;
      rest = hits.rest;
      t = hits.second_t;
      lsp_walk.counts.nodes += 1u;
      ++step;
    }
    while (top > 0u && lsp_wide_over(rest, t, best_t)) {
      --top;
      node = lsp_stack_ref[top];
      rest = lsp_stack_rest[top];
      t = lsp_stack_t[top];
    }
    going = !cut && !lsp_wide_over(rest, t, best_t);
    if (going) {
      LspWideChild child = lsp_load_wide_child(scene, node, rest & 7u);
      rest = ((rest >> 3u) & 0x1FFFFFu) | ((rest >> 24u) - 1u) << 24u;
      going = (child.bits & LSP_WIDE_NODE_BIT) != 0u;
      if (!going) {
        cut = step >= most;
        leaf = LSP_LEAF_BIT | ((child.bits >> LSP_WIDE_LEAF_COUNT_SHIFT) & LSP_LEAF_COUNT_MASK) << LSP_LEAF_COUNT_SHIFT |
               ((child.triangle_first + (child.bits & LSP_WIDE_LEAF_FIRST_MASK)) & LSP_LEAF_FIRST_MASK);
        leaf = cut ? LSP_NONE : leaf;
        ++step;
      } else {
        visit = child.node_first + (child.bits & ~LSP_WIDE_NODE_BIT);
        if (rest >= (1u << 24u)) {
          cut = top >= LSP_STACK_SIZE;
          going = !cut;
          if (going) {
            lsp_stack_ref[top] = node;
            lsp_stack_rest[top] = rest;
            lsp_stack_t[top] = t;
            ++top;
          }
        }
      }
    }
  }
  lsp_walk.step = step;
  lsp_walk.top = top;
  lsp_walk.node = node;
  lsp_walk.rest = rest;
  lsp_walk.t = t;
  lsp_walk.ref = leaf;
  if (!going && leaf == LSP_NONE && !cut) lsp_stack_ref[0] = LSP_NONE;
}

LSP_STEP void lsp_test_leaf(LspScene scene, LspSetup s) {
  uint first = lsp_walk.ref & LSP_LEAF_FIRST_MASK;
  uint count = ((lsp_walk.ref >> LSP_LEAF_COUNT_SHIFT) & LSP_LEAF_COUNT_MASK) + 1u;
  lsp_walk.counts.triangles += count;
  LspBest best = lsp_walk.best;
  for (uint i = 0u; i < count; ++i) best = lsp_triangle(scene, s, first + i, best);
  lsp_walk.best = best;
  lsp_walk.ref = LSP_NONE;
}

/* There are no tables. */
LSP_STEP void lsp_look_up(LspScene, LspSetup, LspQuery) {}

LSP_STEP LspBest lsp_end(LspScene) {
  lsp_walk.best.complete = lsp_stack_ref[0] == LSP_NONE;
  return lsp_walk.best;
}
