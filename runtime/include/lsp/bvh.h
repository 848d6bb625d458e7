/* Traversal of a BVH, in the common subset of GLSL 4.6 and C++20; lsp/traverse.h includes it. */

/* Of a node's two children the one to be visited later, and where the ray enters it. */
uint lsp_stack_ref[LSP_STACK_SIZE];
float lsp_stack_t[LSP_STACK_SIZE];

/* How far the ray has come. */
struct LspWalk {
  LspBest best;
  uint ref; /* what is to be visited or was found; LSP_NONE: nothing */
  uint top; /* of the stack */
  uint step;
  LspCounts counts;
};
LspWalk lsp_walk;

/* What a node leaves to visit: `first`, and of two children later `second`; LSP_NONE: nothing. */
struct LspChildren {
  uint first;
  uint second;
  float second_t; /* where the ray enters it */
};

/* Nearer of the two first; for any hit child 0, which the builder chose to be of larger area, where a hit is
 * likeliest. */
LSP_FN LspChildren lsp_children(LspSetup s, LspQuery q, LspNode node, float best_t) {
  vec3 lo0 = lsp_vec3(node.lo0);
  vec3 hi0 = lsp_vec3(node.hi0);
  vec3 lo1 = lsp_vec3(node.lo1);
  vec3 hi1 = lsp_vec3(node.hi1);
  float t0 = lsp_box(s, lo0, hi0, best_t);
  float t1 = lsp_box(s, lo1, hi1, best_t);
  uint ref0 = LSP_NONE;
  uint ref1 = LSP_NONE;
  if (t0 <= best_t) ref0 = lsp_visit(s, q, node.child0, node.line_space0, lo0, hi0, t0);
  if (t1 <= best_t) ref1 = lsp_visit(s, q, node.child1, node.line_space1, lo1, hi1, t1);
  LspChildren children;
  children.second = LSP_NONE;
  children.second_t = t1;
  if (ref0 == LSP_NONE || ref1 == LSP_NONE) {
    children.first = ref0 != LSP_NONE ? ref0 : ref1;
  } else if ((q.flags & LSP_TRACE_ANY_HIT) != 0u || t0 <= t1) {
    children.first = ref0;
    children.second = ref1;
  } else {
    children.first = ref1;
    children.second = ref0;
    children.second_t = t0;
  }
  return children;
}

/* No ray is treated apart. */
LSP_FN bool lsp_is_far(LspScene, LspSetup) { return false; }

/* To what the ray visits first; LSP_NONE: it is answered already.
 *
 * A device may end every loop early, the inner ones too (lavapipe does), and then only memory tells: what the
 * compiler knows to hold behind a loop does not. Entry 0 of the stack is LSP_NONE once all work is done. */
LSP_STEP void lsp_begin(LspScene scene, LspSetup s, LspQuery q) {
  lsp_walk.best = lsp_no_best(s);
  lsp_walk.top = 0u;
  lsp_walk.step = 0u;
  lsp_walk.counts = lsp_no_counts();
  lsp_walk.ref = LSP_NONE;
  vec3 lo = lsp_vec3(lsp_load_header(scene).bounds_min);
  vec3 hi = lsp_vec3(lsp_load_header(scene).bounds_max);
  float t = lsp_box(s, lo, hi, s.tmax);
  if (t <= s.tmax) {
    uint line_space = lsp_load_header(scene).root_line_space;
    lsp_walk.ref = lsp_visit(s, q, lsp_load_header(scene).root, line_space, lo, hi, t);
  }
  lsp_stack_ref[0] = lsp_walk.ref;
}

/* What to visit next: `ref`, or where that is LSP_NONE of the stack whatever is not behind the best hit. */
struct LspNext {
  uint ref;
  uint top; /* of the stack */
};

LSP_STEP LspNext lsp_pop_where_none(LspNext next, float best_t) {
  while (next.top > 0u && next.ref == LSP_NONE) {
    --next.top;
    if (lsp_stack_t[next.top] <= best_t) next.ref = lsp_stack_ref[next.top];
  }
  return next;
}

/* Steps that a ray takes at most: what max_steps counts and, where their nodes may follow, the Line Spaces it
 * asks. */
LSP_FN uint lsp_most_steps(LspScene scene, LspQuery q) {
  bool follow = (q.flags & LSP_TRACE_NEAR_SKIP) != 0u || (LSP_PARTS & LSP_PART_COVERAGE) != 0u;
  uint asked = follow ? lsp_load_header(scene).line_space_count : 0u;
  return lsp_load_header(scene).max_steps + asked;
}

/* Down to the next leaf or Line Space; LSP_NONE: there is none. Where invocations run in step, those that
 * have found one wait for the others, and no step pays for both (Aila, Laine, "Understanding the Efficiency
 * of Ray Traversal on GPUs", 2009: while-while). On lavapipe 1.4 to 1.9 times as fast as a step of either
 * kind. */
LSP_STEP void lsp_advance(LspScene scene, LspSetup s, LspQuery q) {
  bool found = (q.flags & LSP_TRACE_ANY_HIT) != 0u && lsp_walk.best.triangle != LSP_NONE;
  float best_t = lsp_walk.best.t;
  uint most = lsp_most_steps(scene, q);
  uint step = lsp_walk.step;
  LspNext next;
  next.ref = lsp_walk.ref;
  next.top = found ? 0u : lsp_walk.top;
  next = lsp_pop_where_none(next, best_t);
  bool down = lsp_is_node(next.ref) || (next.ref != LSP_NONE && step >= most);
  while (down && step < most) {
    ++step;
    LspChildren children = lsp_children(s, q, lsp_load_node(scene, next.ref), best_t);
    next.ref = children.first;
    if (children.second != LSP_NONE) {
      if (next.top >= LSP_STACK_SIZE) break;
      lsp_stack_ref[next.top] = children.second;
      lsp_stack_t[next.top] = children.second_t;
      ++next.top;
      if (lsp_is_node(children.second)) lsp_fetch_node(scene, q.flags, children.second);
    }
    next = lsp_pop_where_none(next, best_t);
    down = lsp_is_node(next.ref);
  }
  lsp_walk.counts.nodes += step - lsp_walk.step;
  lsp_walk.step = step + 1u;
  lsp_walk.top = next.top;
  lsp_walk.ref = down ? LSP_NONE : next.ref; /* down: out of steps or of stack, or cut short */
  if (!down && next.ref == LSP_NONE && next.top == 0u) lsp_stack_ref[0] = LSP_NONE;
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

LSP_STEP LspBest lsp_end(LspScene) {
  lsp_walk.best.complete = lsp_stack_ref[0] == LSP_NONE;
  return lsp_walk.best;
}
