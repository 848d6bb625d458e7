/* Traversal of a BVH, in the common subset of GLSL 4.6 and C++20; lsp/traverse.h includes it. */
#ifndef LSP_BVH_H
#define LSP_BVH_H

/* What to visit next where nothing follows from the last step: of the stack, whatever is not behind the best hit.
 * A macro, for an array passed to a function is copied in GLSL. */
#define LSP_POP_WHERE_NONE                           \
  while (top > 0u && ref == LSP_NONE) {              \
    --top;                                           \
    if (stack_t[top] <= best.t) ref = stack_ref[top]; \
  }

/* What a node leaves to visit: `first`, and of two children later `second`; LSP_NONE: nothing. */
struct LspChildren {
  uint first;
  uint second;
  float second_t; /* where the ray enters it */
};

/* Nearer of the two first; for any hit child 0, which the builder chose to be of larger area, where a hit is
 * likeliest. */
LSP_FN LspChildren lsp_children(LSP_SCENE_ LSP_IN(LspSetup) s, uint flags, float lod, uint ref,
                                float best_t LSP_COUNTS_PARAM) {
  LSP_COUNT_ADD(nodes, 1u);
  LspNode node = LSP_NODE(ref);
  vec3 lo0 = LSP_LOAD3(node.lo0);
  vec3 hi0 = LSP_LOAD3(node.hi0);
  vec3 lo1 = LSP_LOAD3(node.lo1);
  vec3 hi1 = LSP_LOAD3(node.hi1);
  float t0 = lsp_box(s, lo0, hi0, best_t);
  float t1 = lsp_box(s, lo1, hi1, best_t);
  uint ref0 = LSP_NONE;
  uint ref1 = LSP_NONE;
  if (t0 <= best_t) ref0 = lsp_visit(LSP_SCENE_ARG_ s, flags, lod, node.child0, node.line_space0, lo0, hi0, t0 LSP_COUNTS_ARG);
  if (t1 <= best_t) ref1 = lsp_visit(LSP_SCENE_ARG_ s, flags, lod, node.child1, node.line_space1, lo1, hi1, t1 LSP_COUNTS_ARG);
  LspChildren children;
  children.second = LSP_NONE;
  children.second_t = t1;
  if (ref0 == LSP_NONE || ref1 == LSP_NONE) {
    children.first = ref0 != LSP_NONE ? ref0 : ref1;
  } else if ((flags & LSP_TRACE_ANY_HIT_BIT) != 0u || t0 <= t1) {
    children.first = ref0;
    children.second = ref1;
  } else {
    children.first = ref1;
    children.second = ref0;
    children.second_t = t0;
  }
  return children;
}

/* What a ray visits first. */
LSP_FN uint lsp_root(LSP_SCENE_ LSP_IN(LspSetup) s, uint flags, float lod LSP_COUNTS_PARAM) {
  vec3 lo = LSP_LOAD3(LSP_HEADER.bounds_min);
  vec3 hi = LSP_LOAD3(LSP_HEADER.bounds_max);
  float t = lsp_box(s, lo, hi, s.tmax);
  if (!(t <= s.tmax)) return LSP_NONE;
  return lsp_visit(LSP_SCENE_ARG_ s, flags, lod, LSP_HEADER.root, LSP_HEADER.root_line_space, lo, hi, t LSP_COUNTS_ARG);
}

/* Steps that a ray takes at most: what max_steps counts and, where they are asked, the Line Spaces it begins in. */
LSP_FN uint lsp_most_steps(LSP_SCENE_ uint flags) {
  return LSP_HEADER.max_steps + ((flags & LSP_TRACE_NEAR_SKIP_BIT) != 0u ? LSP_HEADER.line_space_count : 0u);
}

/* Traces from the root. flags: LSP_TRACE_*_BIT. */
LSP_FN LspBest lsp_traverse(LSP_SCENE_ LSP_IN(LspSetup) s, uint flags, float lod LSP_COUNTS_PARAM) {
  LspBest best = lsp_no_best(s);

  uint stack_ref[LSP_STACK_SIZE];
  float stack_t[LSP_STACK_SIZE];
  uint top = 0u;
  bool any_hit = (flags & LSP_TRACE_ANY_HIT_BIT) != 0u;

  uint ref = lsp_root(LSP_SCENE_ARG_ s, flags, lod LSP_COUNTS_ARG);

  /* First nodes, down to something to test, then the test: where invocations run in step, those that have found a
   * leaf wait for the others, and no step pays for both (Aila, Laine, "Understanding the Efficiency of Ray
   * Traversal on GPUs", 2009: while-while). On lavapipe 1.4 to 1.9 times as fast as a step of either kind.
   *
   * A device may end every loop early, the inner ones too (lavapipe does), and then only memory tells: what the
   * compiler knows to hold behind a loop does not. Entry 0 of the stack is LSP_NONE once all work is done. */
  bool done = false;
  stack_ref[0] = ref;
  uint most = lsp_most_steps(LSP_SCENE_ARG_ flags);
  for (uint step = 0u; !done && step < most; ++step) {
    bool down = lsp_is_node(ref);
    while (down && step < most) {
      ++step;
      LspChildren children = lsp_children(LSP_SCENE_ARG_ s, flags, lod, ref, best.t LSP_COUNTS_ARG);
      ref = children.first;
      if (children.second != LSP_NONE) {
        if (top >= LSP_STACK_SIZE) break;
        stack_ref[top] = children.second;
        stack_t[top] = children.second_t;
        ++top;
      }
      LSP_POP_WHERE_NONE
      down = lsp_is_node(ref);
    }
    if (down) break; /* out of steps or of stack, or cut short */
    uint next = LSP_NONE;
    if (ref == LSP_NONE) {
    } else if ((ref & LSP_LEAF_BIT) != 0u) {
      uint first = ref & LSP_LEAF_FIRST_MASK;
      uint count = ((ref >> LSP_LEAF_COUNT_SHIFT) & LSP_LEAF_COUNT_MASK) + 1u;
      LSP_COUNT_ADD(triangles, count);
      uint i = 0u;
      for (; i < count; ++i) lsp_triangle(LSP_SCENE_ARG_ s, first + i, best);
      if (i != count) break; /* cut short; not written as i < count, which compilers take to be false here */
    } else {
      LSP_COUNT_ADD(shafts, 1u);
      if ((flags & LSP_TRACE_NEAR_SKIP_BIT) != 0u && lsp_is_near(ref))
        next = lsp_go_on_near(LSP_SCENE_ARG_ s, ref);
      else
        lsp_look_up(LSP_SCENE_ARG_ s, ref & LSP_STACK_INDEX_MASK, best);
    }
    if (any_hit && best.triangle != LSP_NONE) top = 0u;
    ref = LSP_NONE;
    if ((flags & LSP_TRACE_NEAR_SKIP_BIT) != 0u) ref = next;
    LSP_POP_WHERE_NONE
    done = ref == LSP_NONE && top == 0u;
    if (done) stack_ref[0] = LSP_NONE;
  }
  best.complete = stack_ref[0] == LSP_NONE;
  return best;
}

#endif
