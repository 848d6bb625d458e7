/* Traversal of an NTree, in the common subset of GLSL 4.6 and C++20; lsp/traverse.h includes it where
 * LSP_NTREE is defined. Layout: LspCell in layout.h.
 *
 * A three-dimensional digital differential analyser in every node (Amanatides, Woo, "A Fast Voxel Traversal
 * Algorithm for Ray Tracing", 1987) that computes the next planes from the cell's integer coordinates, not by
 * adding steps: errors do not add up, and neighbours agree on the plane between them to the bit.
 *
 * No gaps at borders. The cells visited cover the ray up to the rounding of the planes, of the t at which
 * they are crossed, and of the point at which a child node is entered: an error along the axes of at most err
 * = 16 u R + 4 u max|o| (lsp/traverse.h). Where a corner is cut, the cell passed over touches two visited
 * ones in a sliver narrower than err. A cell holds every triangle within ntree_margin of it; while err <=
 * ntree_margin that is the sliver's triangles too. A ray from further away visits all filled cells whose box,
 * grown by err, it hits, in the order of storage.
 */

LSP_FN vec3 lsp_ntree_lo(LspScene scene, ivec3 cell, float size) {
  precise vec3 lo = lsp_vec3(lsp_load_header(scene).ntree_lo) + vec3(cell) * size;
  return lo;
}

/* Where the ray crosses the far planes of a cell, per axis. */
LSP_FN vec3 lsp_ntree_next(LspScene scene, LspSetup s, ivec3 cell, ivec3 ahead, float size) {
  vec3 plane = lsp_ntree_lo(scene, cell + ahead, size);
  precise vec3 t = (plane - s.origin) * s.inverse;
  return t;
}

/* The cell of the node that begins at `base` in which the ray is at t. */
LSP_FN ivec3 lsp_ntree_enter(LspScene scene, LspSetup s, ivec3 base, float size, float t) {
  vec3 corner = lsp_ntree_lo(scene, base, size);
  precise vec3 q = ((s.origin + s.direction * t) - corner) / size;
  float top = float(lsp_load_header(scene).ntree_branching) - 0.5f;
  q.x = q.x > 0.0f ? q.x : 0.0f;
  q.y = q.y > 0.0f ? q.y : 0.0f;
  q.z = q.z > 0.0f ? q.z : 0.0f;
  q.x = q.x < top ? q.x : top;
  q.y = q.y < top ? q.y : top;
  q.z = q.z < top ? q.z : top;
  return base + ivec3(int(q.x), int(q.y), int(q.z));
}

/* Edge of the cells of a node at `depth`, the root's being 0. */
LSP_FN float lsp_ntree_cell_size(LspScene scene, uint depth) {
  uint n = lsp_load_header(scene).ntree_branching;
  uint cells = n * (depth > 0u ? n : 1u) * (depth > 1u ? n : 1u) * (depth > 2u ? n : 1u);
  precise float size = lsp_load_header(scene).ntree_size / float(cells);
  return size;
}

/* The filled cell of a node after `cell` in the order of storage; n^3 when there is none. */
LSP_FN uint lsp_ntree_next_filled(LspScene scene, uint first_word, uint cell, uint cells) {
  uint next = cell + 1u;
  while (next < cells) {
    uint bits = lsp_load_grid(scene, first_word + (next >> 5u)).bits >> (next & 31u);
    if (bits != 0u) return next + uint(findLSB(bits));
    next = (next | 31u) + 1u;
  }
  return cells;
}

/* g / n of coordinates that are not negative. Integers are divided slowly, on some devices an invocation
 * after the other. (g + 1/2) / n is at least 1 / 2n >= 1/32 away from the next integer; with g < 16^4
 * rounding moves it by less than 1/64. */
LSP_FN ivec3 lsp_ntree_divide(ivec3 g, float per_n) {
  return ivec3(int((float(g.x) + 0.5f) * per_n), int((float(g.y) + 0.5f) * per_n),
               int((float(g.z) + 0.5f) * per_n));
}

/* Nodes left for a child: of one at `depth` entry depth + 1. */
uint lsp_parents[LSP_MAX_NTREE_DEPTH + 1u];

/* How far the ray has come. */
struct LspWalk {
  LspBest best;
  uint ref;   /* what is to be visited or was found; LSP_NONE: nothing */
  uint count; /* of a leaf's references */
  uint node;
  uint depth;   /* of the node, the root's being 0; LSP_NONE: above the root, whose one cell it is */
  ivec3 base;   /* first cell of the node */
  ivec3 cell;   /* global coordinates at the node's depth */
  float size;   /* edge of its cells */
  vec3 next;    /* where the ray crosses the far planes of the cell */
  float t;      /* where it enters the cell */
  float t_last; /* where it leaves the scene's box */
  int axis;     /* of the last step */
  bool visit;   /* the cell is yet to be looked at; false: its child is done */
  uvec4 tested; /* the last triangles tested, that the next cell may hold too */
  uint step;
  LspCounts counts;
};
LspWalk lsp_walk;

LSP_FN ivec3 lsp_ntree_ahead(LspSetup s) {
  return ivec3(s.inverse.x < 0.0f ? 0 : 1, s.inverse.y < 0.0f ? 0 : 1, s.inverse.z < 0.0f ? 0 : 1);
}

/* Into the child of the cell: to the ray's first cell there. */
LSP_STEP void lsp_ntree_down(LspScene scene, LspSetup s, LspQuery q) {
  lsp_parents[lsp_walk.depth + 1u] = lsp_walk.node;
  ++lsp_walk.depth;
  lsp_walk.node = lsp_walk.ref;
  lsp_walk.base = lsp_walk.cell * int(lsp_load_header(scene).ntree_branching);
  lsp_walk.size = lsp_ntree_cell_size(scene, lsp_walk.depth);
  lsp_walk.cell = q.far ? lsp_walk.base : lsp_ntree_enter(scene, s, lsp_walk.base, lsp_walk.size, lsp_walk.t);
  lsp_walk.next = lsp_ntree_next(scene, s, lsp_walk.cell, lsp_ntree_ahead(s), lsp_walk.size);
  lsp_walk.visit = true;
}

/* Out of the node to its cell in its parent. */
LSP_STEP void lsp_ntree_up(LspScene scene, LspSetup s, float per_n) {
  lsp_walk.node = lsp_parents[lsp_walk.depth];
  --lsp_walk.depth;
  lsp_walk.cell = lsp_ntree_divide(lsp_walk.base, per_n);
  lsp_walk.base = lsp_ntree_divide(lsp_walk.cell, per_n) * int(lsp_load_header(scene).ntree_branching);
  lsp_walk.size = lsp_ntree_cell_size(scene, lsp_walk.depth);
  lsp_walk.next = lsp_ntree_next(scene, s, lsp_walk.cell, lsp_ntree_ahead(s), lsp_walk.size);
}

LSP_STEP uint lsp_ntree_index(LspScene scene) {
  ivec3 local = lsp_walk.cell - lsp_walk.base;
  return LSP_CELL_INDEX(uint(local.x), uint(local.y), uint(local.z), lsp_load_header(scene).ntree_branching);
}

/* To what the cell holds: LSP_NONE, a node, a Line Space, or a leaf of `count` references. */
LSP_STEP void lsp_ntree_look(LspScene scene, LspSetup s, LspQuery q) {
  lsp_walk.counts.nodes += 1u;
  lsp_walk.count = 0u;
  lsp_walk.ref = LSP_NONE;
  uint index = lsp_ntree_index(scene);
  LspBitWord word = lsp_load_grid(
      scene, lsp_walk.node * LSP_GRID_WORDS(lsp_load_header(scene).ntree_branching) + (index >> 5u));
  uint bit = index & 31u;
  if (((word.bits >> bit) & 1u) == 0u) return;
  LspCell record = lsp_load_cell(scene, word.offset + uint(bitCount(word.bits & ((1u << bit) - 1u))));
  lsp_walk.count = record.count;
  lsp_walk.ref = record.child;
  bool asks = (q.flags & LSP_TRACE_APPROXIMATE) != 0u;
  if (q.far || (record.line_space != LSP_NONE && asks)) {
    vec3 lo = lsp_ntree_lo(scene, lsp_walk.cell, lsp_walk.size);
    vec3 hi = lsp_ntree_lo(scene, lsp_walk.cell + ivec3(1), lsp_walk.size);
    if (q.far) {
      lsp_walk.t = lsp_box(s, lo, hi, lsp_walk.best.t);
      if (!(lsp_walk.t <= lsp_walk.best.t)) lsp_walk.ref = LSP_NONE;
    }
    if (lsp_walk.t <= lsp_walk.best.t)
      lsp_walk.ref = lsp_visit(s, q, lsp_walk.ref, record.line_space, lo, hi, lsp_walk.t);
  }
}

/* On to the next cell; lsp_walk.visit is false where the node has no more. */
LSP_STEP void lsp_ntree_on(LspScene scene, LspSetup s, LspQuery q, float per_n) {
  uint n = lsp_load_header(scene).ntree_branching;
  if (q.far) {
    uint cells = n * n * n;
    uint index =
        lsp_ntree_next_filled(scene, lsp_walk.node * LSP_GRID_WORDS(n), lsp_ntree_index(scene), cells);
    int row = int((float(index) + 0.5f) * per_n);
    int plane = int((float(row) + 0.5f) * per_n);
    lsp_walk.cell = lsp_walk.base + ivec3(int(index) - row * int(n), row - plane * int(n), plane);
    lsp_walk.visit = index != cells;
    return;
  }
  /* Out of a child the parent goes on along the same axis: its own planes may differ from the child's by a
   * rounding, and that is any distance along a ray that is nearly parallel to them. */
  if (lsp_walk.visit) {
    lsp_walk.axis = lsp_walk.next.x <= lsp_walk.next.y ? (lsp_walk.next.x <= lsp_walk.next.z ? 0 : 2)
                                                       : (lsp_walk.next.y <= lsp_walk.next.z ? 1 : 2);
    lsp_walk.t =
        lsp_max(lsp_walk.t, lsp_walk.axis == 0 ? lsp_walk.next.x
                                               : (lsp_walk.axis == 1 ? lsp_walk.next.y : lsp_walk.next.z));
  }
  ivec3 ahead = lsp_ntree_ahead(s);
  int coordinate;
  if (lsp_walk.axis == 0) {
    lsp_walk.cell.x += 2 * ahead.x - 1;
    coordinate = lsp_walk.cell.x - lsp_walk.base.x;
    lsp_walk.next.x = lsp_ntree_next(scene, s, lsp_walk.cell, ahead, lsp_walk.size).x;
  } else if (lsp_walk.axis == 1) {
    lsp_walk.cell.y += 2 * ahead.y - 1;
    coordinate = lsp_walk.cell.y - lsp_walk.base.y;
    lsp_walk.next.y = lsp_ntree_next(scene, s, lsp_walk.cell, ahead, lsp_walk.size).y;
  } else {
    lsp_walk.cell.z += 2 * ahead.z - 1;
    coordinate = lsp_walk.cell.z - lsp_walk.base.z;
    lsp_walk.next.z = lsp_ntree_next(scene, s, lsp_walk.cell, ahead, lsp_walk.size).z;
  }
  lsp_walk.visit = uint(coordinate) < n;
}

/* Whether cells do not cover the ray: see the top of this file. */
LSP_FN bool lsp_is_far(LspScene scene, LspSetup s) { return s.err > lsp_load_header(scene).ntree_margin; }

/* To what the ray visits first; LSP_NONE: it is answered already. Entry 0 of lsp_parents: as that of the
 * stack in lsp/bvh.h. */
LSP_STEP void lsp_begin(LspScene scene, LspSetup s, LspQuery q) {
  vec3 bounds_lo = lsp_vec3(lsp_load_header(scene).bounds_min);
  vec3 bounds_hi = lsp_vec3(lsp_load_header(scene).bounds_max);
  lsp_walk.best = lsp_no_best(s);
  lsp_walk.ref = LSP_NONE;
  lsp_walk.count = 0u;
  lsp_walk.node = 0u;
  lsp_walk.depth = LSP_NONE;
  lsp_walk.base = ivec3(0);
  lsp_walk.cell = ivec3(0);
  lsp_walk.size = lsp_load_header(scene).ntree_size;
  lsp_walk.next = vec3(0.0f);
  lsp_walk.t = lsp_box(s, bounds_lo, bounds_hi, s.tmax);
  lsp_walk.t_last = lsp_box_exit(s, bounds_lo, bounds_hi);
  lsp_walk.axis = 0;
  lsp_walk.visit = false;
  lsp_walk.tested = uvec4(LSP_NONE);
  lsp_walk.step = 0u;
  lsp_walk.counts = lsp_no_counts();
  if (lsp_walk.t <= s.tmax) {
    vec3 lo = lsp_vec3(lsp_load_header(scene).ntree_lo);
    vec3 hi = lo + vec3(lsp_load_header(scene).ntree_size);
    uint line_space = lsp_load_header(scene).root_line_space;
    lsp_walk.ref = lsp_visit(s, q, lsp_load_header(scene).root, line_space, lo, hi, lsp_walk.t);
  }
  lsp_parents[0] = lsp_walk.ref;
}

/* From what was found last, or a child of the cell, to the next leaf or Line Space; LSP_NONE: there is none.
 */
LSP_STEP void lsp_advance(LspScene scene, LspSetup s, LspQuery q) {
  /* What max_steps does not count: the way into the root, and Line Spaces, each of which is asked once. */
  uint most = lsp_load_header(scene).max_steps + 1u + lsp_load_header(scene).line_space_count;
  float per_n = 1.0f / float(lsp_load_header(scene).ntree_branching);
  bool done = false;
  bool going = lsp_walk.ref == LSP_NONE || lsp_is_node(lsp_walk.ref);
  while (going && lsp_walk.step < most) {
    ++lsp_walk.step;
    if (lsp_is_node(lsp_walk.ref) && lsp_walk.depth + 1u < LSP_MAX_NTREE_DEPTH) {
      lsp_ntree_down(scene, s, q);
    } else {
      done = lsp_walk.depth == LSP_NONE; /* back above the root */
      if (!done) lsp_ntree_on(scene, s, q, per_n);
      bool found = (q.flags & LSP_TRACE_ANY_HIT) != 0u && lsp_walk.best.triangle != LSP_NONE;
      bool passed = !q.far && (lsp_walk.t > lsp_walk.best.t || lsp_walk.t > lsp_walk.t_last);
      done = done || found || passed || (!lsp_walk.visit && lsp_walk.depth == 0u);
      if (!done && !lsp_walk.visit) lsp_ntree_up(scene, s, per_n);
    }
    lsp_walk.ref = LSP_NONE;
    if (lsp_walk.visit && !done) lsp_ntree_look(scene, s, q);
    going = !done && (lsp_walk.ref == LSP_NONE || lsp_is_node(lsp_walk.ref));
  }
  if (done) lsp_parents[0] = LSP_NONE;
  if (going) lsp_walk.ref = LSP_NONE; /* out of steps, or cut short */
  if ((lsp_walk.ref & LSP_LEAF_BIT) == 0u) ++lsp_walk.step;
}

LSP_FN bool lsp_ntree_tested(uvec4 tested, uint triangle) {
  return triangle == tested.x || triangle == tested.y || triangle == tested.z || triangle == tested.w;
}

LSP_STEP uint lsp_ntree_leaf_count(LspScene scene) {
  uint most = lsp_load_header(scene).max_leaf_triangles;
  return lsp_walk.count < most ? lsp_walk.count : most;
}

LSP_STEP void lsp_test_leaf(LspScene scene, LspSetup s) {
  uint first = lsp_walk.ref & ~LSP_LEAF_BIT;
  uint count = lsp_ntree_leaf_count(scene);
  for (uint i = 0u; i < count; ++i) {
    uint triangle = lsp_load_reference(scene, first + i);
    if (lsp_ntree_tested(lsp_walk.tested, triangle)) continue;
    lsp_walk.counts.triangles += 1u;
    lsp_walk.best = lsp_triangle(scene, s, triangle, lsp_walk.best);
    lsp_walk.tested = uvec4(lsp_walk.tested.y, lsp_walk.tested.z, lsp_walk.tested.w, triangle);
  }
  lsp_walk.step += count;
  lsp_walk.ref = LSP_NONE;
}

LSP_STEP LspBest lsp_end(LspScene) {
  lsp_walk.best.complete = lsp_parents[0] == LSP_NONE;
  return lsp_walk.best;
}
