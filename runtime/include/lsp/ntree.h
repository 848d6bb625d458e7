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

/* Traces from the root. far: from so far away that cells do not cover the ray, see the top of this file. */
LSP_FN LspBest lsp_traverse_cells(LSP_SCENE_ LSP_IN(LspSetup) s, uint flags, float lod, bool far LSP_COUNTS_PARAM) {
  LspBest best = lsp_no_best(s);

  /* stack[1 + depth]: the node left for its child; stack[0]: as in lsp/bvh.h. */
  uint stack[LSP_MAX_NTREE_DEPTH + 1u];
  bool any_hit = (flags & LSP_TRACE_ANY_HIT_BIT) != 0u;
  int n = int(LSP_HEADER.ntree_branching);
  uint un = uint(n);
  uint words = LSP_GRID_WORDS(un);
  float per_n = 1.0f / float(n);
  bool gone_x = s.inverse.x < 0.0f;
  bool gone_y = s.inverse.y < 0.0f;
  bool gone_z = s.inverse.z < 0.0f;
  ivec3 ahead = ivec3(gone_x ? 0 : 1, gone_y ? 0 : 1, gone_z ? 0 : 1);

  vec3 bounds_lo = LSP_LOAD3(LSP_HEADER.bounds_min);
  vec3 bounds_hi = LSP_LOAD3(LSP_HEADER.bounds_max);
  float t = lsp_box(s, bounds_lo, bounds_hi, best.t);
  float t_last = lsp_box_exit(s, bounds_lo, bounds_hi);
  uint ref = LSP_NONE;
  if (t <= best.t) {
    vec3 lo = LSP_LOAD3(LSP_HEADER.ntree_lo);
    vec3 hi = lo + vec3(LSP_HEADER.ntree_size);
    ref = lsp_visit(LSP_SCENE_ARG_ s, flags, lod, LSP_HEADER.root, LSP_HEADER.root_line_space, lo, hi, t LSP_COUNTS_ARG);
  }
  if ((flags & LSP_TRACE_NEAR_SKIP_BIT) != 0u && lsp_is_near(ref)) {
    LSP_COUNT_ADD(shafts, 1u);
    ref = lsp_go_on_near(LSP_SCENE_ARG_ s, ref, LSP_HEADER.root);
  }
  bool done = ref == LSP_NONE;
  if (!done && (ref & LSP_STACK_LINE_SPACE_BIT) != 0u) {
    LSP_COUNT_ADD(shafts, 1u);
    lsp_look_up(LSP_SCENE_ARG_ s, ref & ~LSP_STACK_LINE_SPACE_BIT, best);
    done = true;
  }
  stack[0] = done ? LSP_NONE : 0u;

  uint depth = 0u;
  uint node = ref;
  ivec3 base = ivec3(0);
  float size = lsp_ntree_cell_size(LSP_SCENE_ARG_ 0u);
  ivec3 cell = far ? base : lsp_ntree_enter(LSP_SCENE_ARG_ s, base, size, t);
  vec3 next = lsp_ntree_next(LSP_SCENE_ARG_ s, cell, ahead, size);
  bool visit = true; /* the cell is yet to be looked at; false: its child is done */
  int axis = 0;      /* of the last step */
  uvec4 tested = uvec4(LSP_NONE, LSP_NONE, LSP_NONE, LSP_NONE); /* the last triangles, that the next cell may hold too */

  for (uint step = 0u; !done && step < LSP_HEADER.max_steps; ++step) {
    ivec3 local = cell - base;
    uint index = LSP_CELL_INDEX(uint(local.x), uint(local.y), uint(local.z), un);
    bool entered = false;
    if (visit) {
      LSP_COUNT_ADD(nodes, 1u);
      LspBitWord word = LSP_GRID(node * words + (index >> 5u));
      uint bit = index & 31u;
      if (((word.bits >> bit) & 1u) != 0u) {
        LspCell record = LSP_CELL(word.offset + uint(bitCount(word.bits & ((1u << bit) - 1u))));
        ref = record.child;
        if (far || (record.line_space != LSP_NONE && (flags & (LSP_TRACE_APPROXIMATE_BIT | LSP_TRACE_SKIP_EMPTY_BIT)) != 0u)) {
          vec3 lo = lsp_ntree_lo(LSP_SCENE_ARG_ cell, size);
          vec3 hi = lsp_ntree_lo(LSP_SCENE_ARG_ cell + ivec3(1), size);
          if (far) {
            t = lsp_box(s, lo, hi, best.t);
            if (!(t <= best.t)) ref = LSP_NONE;
          }
          if (t <= best.t) ref = lsp_visit(LSP_SCENE_ARG_ s, flags, lod, ref, record.line_space, lo, hi, t LSP_COUNTS_ARG);
          if ((flags & LSP_TRACE_NEAR_SKIP_BIT) != 0u && lsp_is_near(ref)) {
            LSP_COUNT_ADD(shafts, 1u);
            ref = lsp_go_on_near(LSP_SCENE_ARG_ s, ref, record.child);
          }
        }
        if (ref == LSP_NONE) {
        } else if ((ref & LSP_LEAF_BIT) != 0u) {
          uint first = ref & ~LSP_LEAF_BIT;
          uint count = record.count < LSP_HEADER.max_leaf_triangles ? record.count : LSP_HEADER.max_leaf_triangles;
          uint i = 0u;
          for (; i < count; ++i) {
            uint triangle = LSP_REFERENCE(first + i);
            if (triangle == tested.x || triangle == tested.y || triangle == tested.z || triangle == tested.w) continue;
            LSP_COUNT_ADD(triangles, 1u);
            lsp_triangle(LSP_SCENE_ARG_ s, triangle, best);
            tested = uvec4(tested.y, tested.z, tested.w, triangle);
          }
          if (i != count) break;
          step += count;
        } else if ((ref & LSP_STACK_LINE_SPACE_BIT) != 0u) {
          LSP_COUNT_ADD(shafts, 1u);
          lsp_look_up(LSP_SCENE_ARG_ s, ref & ~LSP_STACK_LINE_SPACE_BIT, best);
        } else if (depth + 1u < LSP_MAX_NTREE_DEPTH) {
          stack[1u + depth] = node;
          node = ref;
          ++depth;
          base = cell * n;
          size = lsp_ntree_cell_size(LSP_SCENE_ARG_ depth);
          cell = far ? base : lsp_ntree_enter(LSP_SCENE_ARG_ s, base, size, t);
          next = lsp_ntree_next(LSP_SCENE_ARG_ s, cell, ahead, size);
          entered = true;
        }
      }
    }
    if (!entered) {
      /* On to the next cell; out of the node where it has no more. */
      bool out_of_node;
      if (far) {
        index = lsp_ntree_next_filled(LSP_SCENE_ARG_ node * words, index, un * un * un);
        out_of_node = index == un * un * un;
        int row = int((float(index) + 0.5f) * per_n);
        int plane = int((float(row) + 0.5f) * per_n);
        cell = base + ivec3(int(index) - row * n, row - plane * n, plane);
      } else {
        /* Out of a child the parent goes on along the same axis: its own planes may differ from the child's by a
         * rounding, and that is any distance along a ray that is nearly parallel to them. */
        if (visit) {
          axis = next.x <= next.y ? (next.x <= next.z ? 0 : 2) : (next.y <= next.z ? 1 : 2);
          t = lsp_max(t, axis == 0 ? next.x : (axis == 1 ? next.y : next.z));
        }
        int coordinate;
        if (axis == 0) {
          cell.x += gone_x ? -1 : 1;
          coordinate = cell.x - base.x;
          next.x = lsp_ntree_next(LSP_SCENE_ARG_ s, cell, ahead, size).x;
        } else if (axis == 1) {
          cell.y += gone_y ? -1 : 1;
          coordinate = cell.y - base.y;
          next.y = lsp_ntree_next(LSP_SCENE_ARG_ s, cell, ahead, size).y;
        } else {
          cell.z += gone_z ? -1 : 1;
          coordinate = cell.z - base.z;
          next.z = lsp_ntree_next(LSP_SCENE_ARG_ s, cell, ahead, size).z;
        }
        out_of_node = uint(coordinate) >= un;
      }
      visit = !out_of_node;
      bool passed = !far && (t > best.t || t > t_last);
      if ((any_hit && best.triangle != LSP_NONE) || passed || (out_of_node && depth == 0u)) {
        done = true;
        stack[0] = LSP_NONE;
      } else if (out_of_node) {
        --depth;
        node = stack[1u + depth];
        cell = lsp_ntree_divide(base, per_n);
        base = lsp_ntree_divide(cell, per_n) * n;
        size = lsp_ntree_cell_size(LSP_SCENE_ARG_ depth);
        next = lsp_ntree_next(LSP_SCENE_ARG_ s, cell, ahead, size);
      }
    } else {
      visit = true;
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
