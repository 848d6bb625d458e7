/* Traversal of an NTree, in the common subset of GLSL 4.6 and C++20; lsp/traverse.h includes it where LSP_NTREE
 * is defined. Layout: LspCell in layout.h.
 *
 * A three-dimensional digital differential analyser in every node (Amanatides, Woo, "A Fast Voxel Traversal
 * Algorithm for Ray Tracing", 1987) that computes the next planes from the cell's integer coordinates, not by
 * adding steps: errors do not add up, and neighbours agree on the plane between them to the bit.
 *
 * No gaps at borders. The cells visited cover the ray up to the rounding of the planes, of the t at which they are
 * crossed, and of the point at which a child node is entered: an error along the axes of at most
 * err = 16 u R + 4 u max|o| (lsp/traverse.h). Where a corner is cut, the cell passed over touches two visited ones
 * in a sliver narrower than err. A cell holds every triangle within ntree_margin of it; while err <= ntree_margin
 * that is the sliver's triangles too. A ray from further away visits all filled cells whose box, grown by err, it
 * hits, in the order of storage.
 */
#ifndef LSP_NTREE_H
#define LSP_NTREE_H

LSP_FN vec3 lsp_ntree_lo(LSP_SCENE_ ivec3 cell, float size) {
  LSP_PRECISE vec3 lo = LSP_LOAD3(LSP_HEADER.ntree_lo) + vec3(cell) * size;
  return lo;
}

/* Where the ray crosses the far planes of a cell, per axis. */
LSP_FN vec3 lsp_ntree_next(LSP_SCENE_ LSP_IN(LspSetup) s, ivec3 cell, ivec3 ahead, float size) {
  vec3 plane = lsp_ntree_lo(LSP_SCENE_ARG_ cell + ahead, size);
  LSP_PRECISE vec3 t = (plane - s.origin) * s.inverse;
  return t;
}

/* The cell of the node that begins at `base` in which the ray is at t. */
LSP_FN ivec3 lsp_ntree_enter(LSP_SCENE_ LSP_IN(LspSetup) s, ivec3 base, float size, float t) {
  vec3 corner = lsp_ntree_lo(LSP_SCENE_ARG_ base, size);
  LSP_PRECISE vec3 q = ((s.origin + s.direction * t) - corner) / size;
  float top = float(LSP_HEADER.ntree_branching) - 0.5f;
  q.x = q.x > 0.0f ? q.x : 0.0f;
  q.y = q.y > 0.0f ? q.y : 0.0f;
  q.z = q.z > 0.0f ? q.z : 0.0f;
  q.x = q.x < top ? q.x : top;
  q.y = q.y < top ? q.y : top;
  q.z = q.z < top ? q.z : top;
  return base + ivec3(int(q.x), int(q.y), int(q.z));
}

/* Edge of the cells of a node at `depth`, the root's being 0. */
LSP_FN float lsp_ntree_cell_size(LSP_SCENE_ uint depth) {
  uint n = LSP_HEADER.ntree_branching;
  uint cells = n * (depth > 0u ? n : 1u) * (depth > 1u ? n : 1u) * (depth > 2u ? n : 1u);
  LSP_PRECISE float size = LSP_HEADER.ntree_size / float(cells);
  return size;
}

/* The filled cell of a node after `cell` in the order of storage; n^3 when there is none. */
LSP_FN uint lsp_ntree_next_filled(LSP_SCENE_ uint first_word, uint cell, uint cells) {
  uint next = cell + 1u;
  while (next < cells) {
    uint bits = LSP_GRID(first_word + (next >> 5u)).bits >> (next & 31u);
    if (bits != 0u) return next + uint(findLSB(bits));
    next = (next | 31u) + 1u;
  }
  return cells;
}

/* g / n of coordinates that are not negative. Integers are divided slowly, on some devices an invocation after the
 * other. (g + 1/2) / n is at least 1 / 2n >= 1/32 away from the next integer; with g < 16^4 rounding moves it by
 * less than 1/64. */
LSP_FN ivec3 lsp_ntree_divide(ivec3 g, float per_n) {
  return ivec3(int((float(g.x) + 0.5f) * per_n), int((float(g.y) + 0.5f) * per_n), int((float(g.z) + 0.5f) * per_n));
}

/* Where a ray is. */
struct LspCells {
  uint node;
  uint depth;  /* of the node, the root's being 0 */
  ivec3 base;  /* first cell of the node */
  ivec3 cell;  /* global coordinates at the node's depth */
  float size;  /* edge of its cells */
  vec3 next;   /* where the ray crosses the far planes of the cell */
  float t;     /* where it enters the cell */
  int axis;    /* of the last step */
  bool visit;  /* the cell is yet to be looked at; false: its child is done */
};

LSP_FN ivec3 lsp_ntree_ahead(LSP_IN(LspSetup) s) {
  return ivec3(s.inverse.x < 0.0f ? 0 : 1, s.inverse.y < 0.0f ? 0 : 1, s.inverse.z < 0.0f ? 0 : 1);
}

/* To the first cell of the ray in `node`, which begins at c.base and is as deep as c.depth says. */
LSP_FN void lsp_ntree_begin(LSP_SCENE_ LSP_IN(LspSetup) s, bool far, uint node, LSP_INOUT(LspCells) c) {
  c.node = node;
  c.size = lsp_ntree_cell_size(LSP_SCENE_ARG_ c.depth);
  c.cell = far ? c.base : lsp_ntree_enter(LSP_SCENE_ARG_ s, c.base, c.size, c.t);
  c.next = lsp_ntree_next(LSP_SCENE_ARG_ s, c.cell, lsp_ntree_ahead(s), c.size);
  c.visit = true;
}

/* Into the child of the cell. */
LSP_FN void lsp_ntree_down(LSP_SCENE_ LSP_IN(LspSetup) s, bool far, uint child, LSP_INOUT(LspCells) c) {
  ++c.depth;
  c.base = c.cell * int(LSP_HEADER.ntree_branching);
  lsp_ntree_begin(LSP_SCENE_ARG_ s, far, child, c);
}

/* Out of the node to its cell in `parent`. */
LSP_FN void lsp_ntree_up(LSP_SCENE_ LSP_IN(LspSetup) s, uint parent, float per_n, LSP_INOUT(LspCells) c) {
  --c.depth;
  c.node = parent;
  c.cell = lsp_ntree_divide(c.base, per_n);
  c.base = lsp_ntree_divide(c.cell, per_n) * int(LSP_HEADER.ntree_branching);
  c.size = lsp_ntree_cell_size(LSP_SCENE_ARG_ c.depth);
  c.next = lsp_ntree_next(LSP_SCENE_ARG_ s, c.cell, lsp_ntree_ahead(s), c.size);
}

LSP_FN uint lsp_ntree_index(LSP_SCENE_ LSP_IN(LspCells) c) {
  ivec3 local = c.cell - c.base;
  return LSP_CELL_INDEX(uint(local.x), uint(local.y), uint(local.z), LSP_HEADER.ntree_branching);
}

/* What to visit in the cell: LSP_NONE, a node, a Line Space, or a leaf of `count` references. */
LSP_FN uint lsp_ntree_look(LSP_SCENE_ LSP_IN(LspSetup) s, uint flags, float lod, bool far, float best_t,
                           LSP_INOUT(LspCells) c, LSP_OUT(uint) count LSP_COUNTS_PARAM) {
  LSP_COUNT_ADD(nodes, 1u);
  count = 0u;
  uint index = lsp_ntree_index(LSP_SCENE_ARG_ c);
  LspBitWord word = LSP_GRID(c.node * LSP_GRID_WORDS(LSP_HEADER.ntree_branching) + (index >> 5u));
  uint bit = index & 31u;
  if (((word.bits >> bit) & 1u) == 0u) return LSP_NONE;
  LspCell record = LSP_CELL(word.offset + uint(bitCount(word.bits & ((1u << bit) - 1u))));
  count = record.count;
  uint ref = record.child;
  if (far || (record.line_space != LSP_NONE && (flags & (LSP_TRACE_APPROXIMATE_BIT | LSP_TRACE_SKIP_EMPTY_BIT)) != 0u)) {
    vec3 lo = lsp_ntree_lo(LSP_SCENE_ARG_ c.cell, c.size);
    vec3 hi = lsp_ntree_lo(LSP_SCENE_ARG_ c.cell + ivec3(1), c.size);
    if (far) {
      c.t = lsp_box(s, lo, hi, best_t);
      if (!(c.t <= best_t)) ref = LSP_NONE;
    }
    if (c.t <= best_t) ref = lsp_visit(LSP_SCENE_ARG_ s, flags, lod, ref, record.line_space, lo, hi, c.t LSP_COUNTS_ARG);
  }
  return ref;
}

/* On to the next cell; true: out of the node, which has no more. */
LSP_FN bool lsp_ntree_on(LSP_SCENE_ LSP_IN(LspSetup) s, bool far, float per_n, LSP_INOUT(LspCells) c) {
  uint n = LSP_HEADER.ntree_branching;
  if (far) {
    uint cells = n * n * n;
    uint index = lsp_ntree_next_filled(LSP_SCENE_ARG_ c.node * LSP_GRID_WORDS(n), lsp_ntree_index(LSP_SCENE_ARG_ c), cells);
    int row = int((float(index) + 0.5f) * per_n);
    int plane = int((float(row) + 0.5f) * per_n);
    c.cell = c.base + ivec3(int(index) - row * int(n), row - plane * int(n), plane);
    c.visit = index != cells;
    return index == cells;
  }
  /* Out of a child the parent goes on along the same axis: its own planes may differ from the child's by a
   * rounding, and that is any distance along a ray that is nearly parallel to them. */
  if (c.visit) {
    c.axis = c.next.x <= c.next.y ? (c.next.x <= c.next.z ? 0 : 2) : (c.next.y <= c.next.z ? 1 : 2);
    c.t = lsp_max(c.t, c.axis == 0 ? c.next.x : (c.axis == 1 ? c.next.y : c.next.z));
  }
  ivec3 ahead = lsp_ntree_ahead(s);
  int coordinate;
  if (c.axis == 0) {
    c.cell.x += 2 * ahead.x - 1;
    coordinate = c.cell.x - c.base.x;
    c.next.x = lsp_ntree_next(LSP_SCENE_ARG_ s, c.cell, ahead, c.size).x;
  } else if (c.axis == 1) {
    c.cell.y += 2 * ahead.y - 1;
    coordinate = c.cell.y - c.base.y;
    c.next.y = lsp_ntree_next(LSP_SCENE_ARG_ s, c.cell, ahead, c.size).y;
  } else {
    c.cell.z += 2 * ahead.z - 1;
    coordinate = c.cell.z - c.base.z;
    c.next.z = lsp_ntree_next(LSP_SCENE_ARG_ s, c.cell, ahead, c.size).z;
  }
  c.visit = uint(coordinate) < n;
  return !c.visit;
}

/* What a ray visits first; sets c.t, where it enters the scene's box, and t_last, where it leaves that. */
LSP_FN uint lsp_ntree_root(LSP_SCENE_ LSP_IN(LspSetup) s, uint flags, float lod, LSP_OUT(LspCells) c,
                           LSP_OUT(float) t_last LSP_COUNTS_PARAM) {
  vec3 bounds_lo = LSP_LOAD3(LSP_HEADER.bounds_min);
  vec3 bounds_hi = LSP_LOAD3(LSP_HEADER.bounds_max);
  c.t = lsp_box(s, bounds_lo, bounds_hi, s.tmax);
  c.depth = 0u;
  c.base = ivec3(0);
  c.axis = 0;
  t_last = lsp_box_exit(s, bounds_lo, bounds_hi);
  if (!(c.t <= s.tmax)) return LSP_NONE;
  vec3 lo = LSP_LOAD3(LSP_HEADER.ntree_lo);
  vec3 hi = lo + vec3(LSP_HEADER.ntree_size);
  return lsp_visit(LSP_SCENE_ARG_ s, flags, lod, LSP_HEADER.root, LSP_HEADER.root_line_space, lo, hi, c.t LSP_COUNTS_ARG);
}

/* The last triangles tested, that the next cell may hold too. */
LSP_FN bool lsp_ntree_tested(uvec4 tested, uint triangle) {
  return triangle == tested.x || triangle == tested.y || triangle == tested.z || triangle == tested.w;
}

/* Traces from the root. far: from so far away that cells do not cover the ray, see the top of this file. */
LSP_FN LspBest lsp_traverse_cells(LSP_SCENE_ LSP_IN(LspSetup) s, uint flags, float lod, bool far LSP_COUNTS_PARAM) {
  LspBest best = lsp_no_best(s);

  /* stack[1 + depth]: the node left for its child; stack[0]: as in lsp/bvh.h. */
  uint stack[LSP_MAX_NTREE_DEPTH + 1u];
  bool any_hit = (flags & LSP_TRACE_ANY_HIT_BIT) != 0u;
  float per_n = 1.0f / float(LSP_HEADER.ntree_branching);
  float t_last;
  LspCells c;
  uint ref = lsp_ntree_root(LSP_SCENE_ARG_ s, flags, lod, c, t_last LSP_COUNTS_ARG);
  if ((flags & LSP_TRACE_NEAR_SKIP_BIT) != 0u && lsp_is_near(ref)) {
    LSP_COUNT_ADD(shafts, 1u);
    ref = lsp_go_on_near(LSP_SCENE_ARG_ s, ref);
  }
  bool done = ref == LSP_NONE;
  if (!done && (ref & LSP_STACK_LINE_SPACE_BIT) != 0u) {
    LSP_COUNT_ADD(shafts, 1u);
    lsp_look_up(LSP_SCENE_ARG_ s, ref & LSP_STACK_INDEX_MASK, best);
    done = true;
  }
  stack[0] = done ? LSP_NONE : 0u;
  lsp_ntree_begin(LSP_SCENE_ARG_ s, far, ref, c);
  uvec4 tested = uvec4(LSP_NONE, LSP_NONE, LSP_NONE, LSP_NONE);

  for (uint step = 0u; !done && step < LSP_HEADER.max_steps; ++step) {
    uint count = 0u;
    ref = LSP_NONE;
    if (c.visit) {
      ref = lsp_ntree_look(LSP_SCENE_ARG_ s, flags, lod, far, best.t, c, count LSP_COUNTS_ARG);
      if ((flags & LSP_TRACE_NEAR_SKIP_BIT) != 0u && lsp_is_near(ref)) {
        LSP_COUNT_ADD(shafts, 1u);
        ref = lsp_go_on_near(LSP_SCENE_ARG_ s, ref);
      }
    }
    if (lsp_is_node(ref) && c.depth + 1u < LSP_MAX_NTREE_DEPTH) {
      stack[1u + c.depth] = c.node;
      lsp_ntree_down(LSP_SCENE_ARG_ s, far, ref, c);
    } else {
      if (ref == LSP_NONE) {
      } else if ((ref & LSP_LEAF_BIT) != 0u) {
        uint first = ref & ~LSP_LEAF_BIT;
        count = count < LSP_HEADER.max_leaf_triangles ? count : LSP_HEADER.max_leaf_triangles;
        uint i = 0u;
        for (; i < count; ++i) {
          uint triangle = LSP_REFERENCE(first + i);
          if (lsp_ntree_tested(tested, triangle)) continue;
          LSP_COUNT_ADD(triangles, 1u);
          lsp_triangle(LSP_SCENE_ARG_ s, triangle, best);
          tested = uvec4(tested.y, tested.z, tested.w, triangle);
        }
        if (i != count) break;
        step += count;
      } else if ((ref & LSP_STACK_LINE_SPACE_BIT) != 0u) {
        LSP_COUNT_ADD(shafts, 1u);
        lsp_look_up(LSP_SCENE_ARG_ s, ref & LSP_STACK_INDEX_MASK, best);
      }
      bool out_of_node = lsp_ntree_on(LSP_SCENE_ARG_ s, far, per_n, c);
      bool passed = !far && (c.t > best.t || c.t > t_last);
      if ((any_hit && best.triangle != LSP_NONE) || passed || (out_of_node && c.depth == 0u)) {
        done = true;
        stack[0] = LSP_NONE;
      } else if (out_of_node) {
        lsp_ntree_up(LSP_SCENE_ARG_ s, stack[c.depth], per_n, c);
      }
    }
  }
  best.complete = stack[0] == LSP_NONE;
  return best;
}

#ifdef LSP_SPLIT_FAR
/* The few rays from far away have a loop of their own: without them the other's is 1.07 to 1.12 times as fast on a
 * CPU. A shader has one loop, for a device may run both. */
LSP_FN_RARE LspBest lsp_traverse_far(LSP_SCENE_ LSP_IN(LspSetup) s, uint flags, float lod LSP_COUNTS_PARAM) {
  return lsp_traverse_cells(LSP_SCENE_ARG_ s, flags, lod, true LSP_COUNTS_ARG);
}
#endif

/* Traces from the root. flags: LSP_TRACE_*_BIT. */
LSP_FN LspBest lsp_traverse(LSP_SCENE_ LSP_IN(LspSetup) s, uint flags, float lod LSP_COUNTS_PARAM) {
  bool far = s.err > LSP_HEADER.ntree_margin;
#ifdef LSP_SPLIT_FAR
  if (far) return lsp_traverse_far(LSP_SCENE_ARG_ s, flags, lod LSP_COUNTS_ARG);
  return lsp_traverse_cells(LSP_SCENE_ARG_ s, flags, lod, false LSP_COUNTS_ARG);
#else
  return lsp_traverse_cells(LSP_SCENE_ARG_ s, flags, lod, far LSP_COUNTS_ARG);
#endif
}

#endif
