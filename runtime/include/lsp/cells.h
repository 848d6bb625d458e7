/* Traversal of cells, in the common subset of GLSL 4.6 and C++20; lsp/traverse.h includes it where LSP_CELLS is
 * defined. Layout: LspCellGrid and what follows it in layout.h.
 *
 * A ray goes from cell to cell (Amanatides, Woo, "A Fast Voxel Traversal Algorithm for Ray Tracing", 1987), over
 * empty ones as far as their jump says (Cohen, Sheffer, "Proximity Clouds", 1994). In the cell it begins in it asks
 * the origin table of its sub-cell, in others the far table, which is the paper's Line Space (section 3.1). An entry
 * is empty, a plane, or a split: two answers, and a linear form over the ray's place in the shaft whose sign chooses.
 * An answer that loses more than asked for is not heeded: the ray is traced exactly through this cell, in the cell's
 * own small tree, and goes on from there. What an answer loses is what the bake saw its entry lose, and more or less as
 * the ray's place says: near the border of a split, beyond the cell, or where the ray has just begun. Where any hit
 * will do such cells wait: what a table is sure of, however far, ends the ray without them, and only where none is the
 * ray goes back to them. A ray that misses everything, but leaves the cell it begins in by a way on which the bake
 * found no sky (LspFilledCell.closed), begins again, and every cell is traced exactly.
 *
 * runtime/src/trace_cells_wide.cpp and wide_calls-inl.h state this a second time for rays in vector lanes, operation by
 * operation: what changes here changes there.
 *
 * Everything but the exact trace counts in cells: positions from the grid's lower corner, lengths in edges.
 *
 * Rounding. The grid's planes are crossed at t off by at most 4 u G edges along an axis (G cells, u = 2^-24), for a
 * ray that begins within a few extents; a cell's tree holds what comes within the grid's margin of the cell, 1e-4
 * edges or more, and an exact trace reaches as far beyond the cell's ends. So no triangle is lost between cells.
 */

/* A mark, a child for every level of a cell's tree, and room behind. */
#define LSP_CELL_STACK (LSP_MAX_CELL_DEPTH + 2u)

/* Children of nodes that are yet to be visited, from entry 1 on. Entry 0 is LSP_NONE once all work is done: a device
 * may end loops early, and then only memory tells, see lsp/bvh.h. */
uint lsp_stack_ref[LSP_CELL_STACK];

/* What becomes of cells that are to be traced exactly. */
#define LSP_WALK_CALLS 0u    /* they are, on the way */
#define LSP_WALK_WAITS 1u    /* they wait, see LspWalk.waiting */
#define LSP_WALK_MAKES_UP 2u /* those that waited are, from the first on; the others have answered */
#define LSP_WALK_AGAIN 3u    /* every cell is one, from the beginning of the ray on */
/* The cell of LspWalk.waiting that stands for all behind it, too; it is not the first. */
#define LSP_LAST_WAITING 31u

/* How far the ray has come: it enters `cell` at t, by a side across `axis`, -1 where it begins there. Between passes
 * runtime/vulkan/trace_passes.comp keeps this in memory: what is added here is added there. */
struct LspWalk {
  LspBest best;
  uint ref; /* LSP_LEAF_BIT and the filled cell that it is to be traced exactly in; LSP_NONE: it is answered */
  ivec3 cell;
  float t;
  int axis;
  float t_last; /* where it leaves the grid, or ends */
  ivec3 exact_cell; /* of ref; it has come out of it at t. Of cells that wait the first */
  float exact_t;    /* where it entered that */
  uint step;    /* cells so far, from the beginning on */
  uint waiting; /* by step, bits: cells that wait */
  uint mode;    /* LSP_WALK_* */
  bool closed;  /* it begins where no ray leaves the scene: a miss is a mistake */
  bool any_hit;
  LspCounts counts;
};
LspWalk lsp_walk;

/* A ray in the grid's coordinates; t is the same. */
struct LspCellRay {
  vec3 origin;
  vec3 direction;
  vec3 inverse;
  ivec3 ahead; /* 1: towards larger coordinates */
};

LSP_FN LspCellRay lsp_cell_ray(LspCellGrid grid, LspSetup s) {
  precise vec3 origin = (s.origin - lsp_vec3(grid.lo)) * grid.per_size;
  precise vec3 direction = s.direction * grid.per_size;
  precise vec3 inverse = s.inverse * grid.size;
  LspCellRay r;
  r.origin = origin;
  r.direction = direction;
  r.inverse = inverse;
  r.ahead = ivec3(inverse.x < 0.0f ? 0 : 1, inverse.y < 0.0f ? 0 : 1, inverse.z < 0.0f ? 0 : 1);
  return r;
}

LSP_FN vec3 lsp_cell_dims(LspCellGrid grid) {
  return vec3(float(grid.cells_x), float(grid.cells_y), float(grid.cells_z));
}

/* The cell that a point lies in or is nearest to; of a damaged file it is perhaps no number: then 0 is the larger. */
LSP_FN ivec3 lsp_cell_at(LspCellGrid grid, vec3 p) {
  vec3 dims = lsp_cell_dims(grid);
  return ivec3(int(lsp_min(lsp_max(0.0f, p.x), dims.x - 0.5f)), int(lsp_min(lsp_max(0.0f, p.y), dims.y - 0.5f)),
               int(lsp_min(lsp_max(0.0f, p.z), dims.z - 0.5f)));
}

LSP_FN vec3 lsp_cell_point(LspCellRay r, float t) {
  precise vec3 p = r.origin + r.direction * t;
  return p;
}

LSP_FN float lsp_along(vec3 v, int axis) { return axis == 0 ? v.x : (axis == 1 ? v.y : v.z); }
LSP_FN uint lsp_ahead(LspCellRay r, int axis) {
  return uint(axis == 0 ? r.ahead.x : (axis == 1 ? r.ahead.y : r.ahead.z));
}

/* The two coordinates of a point on a side across an axis. */
LSP_FN float lsp_side_u(vec3 p, int axis) { return axis == 0 ? p.y : p.x; }
LSP_FN float lsp_side_v(vec3 p, int axis) { return axis == 2 ? p.y : p.z; }

LSP_FN vec3 lsp_cell_corner(ivec3 cell) { return vec3(float(cell.x), float(cell.y), float(cell.z)); }

/* Rays from afar are treated as others. */
LSP_FN bool lsp_is_far(LspScene, LspSetup) { return false; }

/* The patch of a coordinate that counts in patches, n of them, and the place in it, from -1 to 1. */
LSP_FN float lsp_cell_patch(float q, float n) {
  float i = floor(q > 0.0f ? q : 0.0f);
  return i < n ? i : n - 1.0f;
}
LSP_FN float lsp_cell_place(float q, float first) {
  precise float place = 2.0f * (q - first) - 1.0f;
  return place;
}

/* Where a ray's entry is, and the ray's place in the shaft. */
struct LspCellLook {
  uint entry; /* LSP_NONE: there is none */
  vec4 place;
  float place_4;
  bool closed; /* of an origin table: LspFilledCell.closed has the way out */
};

/* In the origin table of the sub-cell that a ray begins in, at `from`; it leaves the cell at `to`. Both are seen from
 * the cell's lower corner. */
LSP_FN LspCellLook lsp_cell_origin(LspCellGrid grid, LspFilledCell cell, vec3 from, vec3 to, int axis, uint face) {
  float n = float(grid.sub_cells);
  float m = float(grid.origin_patches);
  precise vec3 p = from * n;
  vec3 sub = vec3(lsp_cell_patch(p.x, n), lsp_cell_patch(p.y, n), lsp_cell_patch(p.z, n));
  uint number = uint(sub.x) + grid.sub_cells * (uint(sub.y) + grid.sub_cells * uint(sub.z));
  precise float u = lsp_side_u(to, axis) * m;
  precise float v = lsp_side_v(to, axis) * m;
  float patch_u = lsp_cell_patch(u, m);
  float patch_v = lsp_cell_patch(v, m);
  LspCellLook look;
  look.closed = ((cell.closed >> LSP_WAY(face, LSP_QUARTER(uint(patch_u), uint(patch_v), grid.origin_patches))) & 1u) != 0u;
  look.place = vec4(lsp_cell_place(p.x, sub.x), lsp_cell_place(p.y, sub.y), lsp_cell_place(p.z, sub.z),
                    lsp_cell_place(u, patch_u));
  look.place_4 = lsp_cell_place(v, patch_v);
  uint bit = number & 31u;
  uint mask = number < 32u ? cell.sub_mask_lo : cell.sub_mask_hi;
  uint table = cell.sub_first + uint(bitCount(mask & ((1u << bit) - 1u))) +
               (number < 32u ? 0u : uint(bitCount(cell.sub_mask_lo)));
  uint patches = grid.origin_patches * grid.origin_patches;
  look.entry = ((mask >> bit) & 1u) == 0u
                   ? LSP_NONE
                   : grid.origin_entry_first + (table * 6u + face) * patches + uint(patch_u) +
                         grid.origin_patches * uint(patch_v);
  return look;
}

/* In the far table of a cell that a ray passes from `from` to `to`. */
LSP_FN LspCellLook lsp_cell_far(LspCellGrid grid, uint index, vec3 from, vec3 to, int axis_in, uint face_in,
                                int axis_out, uint face_out) {
  float n = float(grid.far_patches);
  precise float in_u = lsp_side_u(from, axis_in) * n;
  precise float in_v = lsp_side_v(from, axis_in) * n;
  precise float out_u = lsp_side_u(to, axis_out) * n;
  precise float out_v = lsp_side_v(to, axis_out) * n;
  vec4 first = vec4(lsp_cell_patch(in_u, n), lsp_cell_patch(in_v, n), lsp_cell_patch(out_u, n), lsp_cell_patch(out_v, n));
  LspCellLook look;
  look.place = vec4(lsp_cell_place(in_u, first.x), lsp_cell_place(in_v, first.y), lsp_cell_place(out_u, first.z),
                    lsp_cell_place(out_v, first.w));
  look.place_4 = 0.0f;
  look.closed = false;
  uint patches = grid.far_patches * grid.far_patches;
  uint shaft = LSP_SHAFT_INDEX(face_in, face_out, uint(first.x) + grid.far_patches * uint(first.y),
                               uint(first.z) + grid.far_patches * uint(first.w), grid.far_patches);
  /* In and out by one face, along an edge, there is nothing between. */
  look.entry = face_in == face_out ? LSP_NONE : index * (30u * patches * patches) + shaft;
  return look;
}

/* The same for a ray that begins within the cell, as if it had begun before it. It leaves the cell at `to`. */
LSP_FN LspCellLook lsp_cell_through(LspCellGrid grid, uint index, LspCellRay r, ivec3 cell, vec3 to, int axis_out,
                                    uint face_out) {
  vec3 corner = lsp_cell_corner(cell);
  precise vec3 t_side = (lsp_cell_corner(cell + ivec3(1, 1, 1) - r.ahead) - r.origin) * r.inverse;
  int axis = t_side.x >= t_side.y ? (t_side.x >= t_side.z ? 0 : 2) : (t_side.y >= t_side.z ? 1 : 2);
  vec3 from = lsp_cell_point(r, lsp_along(t_side, axis)) - corner;
  return lsp_cell_far(grid, index, from, to, axis, 2u * uint(axis) + 1u - lsp_ahead(r, axis), axis_out, face_out);
}

LSP_FN float lsp_split_weight(uint bits, uint shift) { return float(int(bits << (26u - shift)) >> 26); }

/* The linear form of a split at a place. */
LSP_FN float lsp_split_side(LspSplit split, vec4 place, float place_4) {
  float w0 = lsp_split_weight(split.weights, 0u);
  float w1 = lsp_split_weight(split.weights, 6u);
  float w2 = lsp_split_weight(split.weights, 12u);
  float w3 = lsp_split_weight(split.weights, 18u);
  float w4 = lsp_split_weight(split.weights, 24u);
  float constant = lsp_split_weight(split.answers, 24u);
  precise float side = constant + w0 * place.x + w1 * place.y + w2 * place.z + w3 * place.w + w4 * place_4;
  return side;
}

/* What an answer loses, in classes: what that of its entry counts for, and more or less as the ray's place says. A class
 * is a factor of about 1.4 in what was lost by 800,000 passages through cells of five scenes, to which all of this is
 * fitted. What is multiplied here is exact in single precision. */
/* Classes of entries, four bits each: what they count for, and 7. */
#define LSP_RISK_ORIGIN 0x0DCBAA96u
#define LSP_RISK_FAR 0x0ECA9880u
#define LSP_RISK_UNKNOWN 64.0f                               /* in place of a class: more than a place takes from it */
#define LSP_RISK_NO_SPLIT(begins) ((begins) ? -2.0f : 1.0f) /* an entry that is empty or knows the sky */

/* Of a split's answer, a plane or nothing: near the border, where the form is zero, more. */
LSP_FN float lsp_split_risk(float side, bool plane, bool begins) {
  float inside = side < 0.0f ? -side : side;
  float far = plane ? lsp_max(-2.0f, 2.0f - 0.125f * inside) : lsp_max(-5.0f, 7.0f - 0.5f * inside);
  float origin = plane ? lsp_max(0.0f, 2.0f - 0.0625f * inside) : lsp_max(-3.0f, 4.0f - 0.125f * inside);
  return begins ? origin : far;
}

/* The plane of the cell that an answer comes to. */
struct LspCellChoice {
  uint plane; /* LSP_NONE: none */
  float risk; /* lsp_split_risk */
};
LSP_FN LspCellChoice lsp_cell_plane(LspScene scene, LspFilledCell cell, uint answer, LspCellLook look, bool begins) {
  LspCellChoice choice;
  choice.plane = cell.plane_first + answer;
  choice.risk = 0.0f;
  if (answer < cell.plane_count) return choice;
  LspSplit split = lsp_load_split(scene, cell.split_first + (answer - cell.plane_count));
  float form = lsp_split_side(split, look.place, look.place_4);
  uint side = (form > 0.0f ? split.answers : split.answers >> 12u) & LSP_SPLIT_MASK;
  choice.plane = side < cell.plane_count ? cell.plane_first + side : LSP_NONE;
  choice.risk = lsp_split_risk(form, side < cell.plane_count, begins);
  return choice;
}

/* Where a ray meets a plane within its passage of a cell, from t_in to t_out; infinity: not. `origin` is the ray's, seen
 * from the cell's centre. What lies before tmin, where the ray begins, is the surface that it left: without that test
 * the slack draws seams along the borders of cells. */
struct LspCellMeeting {
  float t;
  float risk; /* beyond the passage most, and where the ray has just begun, perhaps at the surface that it left */
};
LSP_FN LspCellMeeting lsp_cell_meet(LspPlane plane, vec3 origin, vec3 direction, bool begins, float tmin, float t_in,
                                    float t_out) {
  vec3 normal = lsp_vec3(plane.normal);
  precise float t = (plane.distance - lsp_dot(normal, origin)) / lsp_dot(normal, direction);
  precise float slack = LSP_CELL_SLACK * (t_out - t_in);
  float first = t_in + 2.0f * slack;
  float last = t_out + slack;
  float before = t_in - slack;
  bool ahead = t > tmin && t > (begins ? t_in : before);
  bool meets = ahead && t <= last;
  LspCellMeeting meeting;
  meeting.risk = begins ? (!ahead ? -1.0f : (t < first ? 6.0f : (t <= t_out ? 2.0f : (meets ? 8.0f : 1.0f))))
                        : (!meets ? 0.0f : (t < t_in ? 4.0f : (t <= t_out ? 0.0f : 8.0f)));
  float within = t < t_in ? t_in : t; /* of its own: what is assigned to t would be precise, see lsp_advance */
  meeting.t = meets ? (within > t_out ? t_out : within) : LSP_INFINITY;
  return meeting;
}

/* Whether a cell is to be traced exactly where so many sixteenths of a class are heeded: LSP_DIAL. */
LSP_FN bool lsp_is_lossy(uint loss, float risk, bool begins, uint heeded) {
  uint counts = ((begins ? LSP_RISK_ORIGIN : LSP_RISK_FAR) >> (4u * loss)) & 15u;
  float classes = (loss == LSP_LOSS_UNKNOWN ? LSP_RISK_UNKNOWN : float(counts) - 7.0f) + risk;
  return heeded == 0u || (heeded < LSP_DIAL_PARTS * (LSP_LOSS_UNKNOWN + 1u) &&
                          classes >= float(heeded) * (1.0f / float(LSP_DIAL_PARTS)));
}

LSP_FN int lsp_cell_within(float p, int cell, int jump) {
  float lo = float(cell - jump);
  float hi = float(cell + jump);
  float i = floor(p);
  return int(i > lo ? (i < hi ? i : hi) : lo); /* of a NaN lo */
}

/* A ray's passage of a cell, of an empty one with the cells around it that it may jump over: to where, by which side. */
struct LspCellPassage {
  vec3 to;
  float t_out;
  int axis_out;
  ivec3 next; /* the cell behind */
};
LSP_FN LspCellPassage lsp_cell_pass(LspCellRay r, ivec3 cell, int jump, float t) {
  ivec3 side = cell + r.ahead * (1 + 2 * jump) - ivec3(jump, jump, jump);
  precise vec3 t_side = (lsp_cell_corner(side) - r.origin) * r.inverse;
  LspCellPassage pass;
  pass.axis_out = t_side.x <= t_side.y ? (t_side.x <= t_side.z ? 0 : 2) : (t_side.y <= t_side.z ? 1 : 2);
  pass.t_out = lsp_max(lsp_along(t_side, pass.axis_out), t);
  pass.to = lsp_cell_point(r, pass.t_out);
  ivec3 next = side + r.ahead - ivec3(1, 1, 1);
  pass.next = ivec3(pass.axis_out == 0 ? next.x : lsp_cell_within(pass.to.x, cell.x, jump),
                    pass.axis_out == 1 ? next.y : lsp_cell_within(pass.to.y, cell.y, jump),
                    pass.axis_out == 2 ? next.z : lsp_cell_within(pass.to.z, cell.z, jump));
  return pass;
}

LSP_FN uint lsp_step_bit(uint step) { return 1u << (step < LSP_LAST_WAITING ? step : LSP_LAST_WAITING); }

/* What a filled cell's entry says of a ray that passes it from t to t_out. Answers whether the ray is over: it has its
 * hit, or leaves the scene. Otherwise it goes on, or is to be traced exactly here first, if lsp_walk.ref says so. */
LSP_STEP bool lsp_cell_answer(LspScene scene, LspSetup s, LspQuery q, LspCellRay r, uint index, uint entry,
                              LspCellLook look, ivec3 cell, bool begins, float t, float t_out) {
  lsp_walk.counts.shafts += 1u;
  uint answer = entry & LSP_ANSWER_MASK;
  uint heeded = begins ? q.dial & 0xFFu : q.dial >> 8u;
  bool exactly = (LSP_PARTS & LSP_PART_CELL_EXACT) != 0u && (lsp_walk.mode == LSP_WALK_AGAIN || heeded == 0u);
  uint plane = LSP_NONE;
  float hit = LSP_INFINITY;
  float risk = LSP_RISK_NO_SPLIT(begins);
  if (!exactly && answer < LSP_ANSWER_LIMIT) {
    LspFilledCell answers = lsp_load_cell_answers(scene, index);
    lsp_walk.counts.splits += answer < answers.plane_count ? 0u : 1u;
    LspCellChoice choice = lsp_cell_plane(scene, answers, answer, look, begins);
    plane = choice.plane;
    risk = choice.risk;
    if (plane != LSP_NONE) {
      precise vec3 origin = r.origin - (lsp_cell_corner(cell) + 0.5f);
      LspCellMeeting meeting = lsp_cell_meet(lsp_load_plane(scene, plane), origin, r.direction, begins, s.tmin, t, t_out);
      hit = meeting.t;
      risk += meeting.risk;
    }
  }
  exactly = (LSP_PARTS & LSP_PART_CELL_EXACT) != 0u && (exactly || lsp_is_lossy(entry >> LSP_LOSS_SHIFT, risk, begins, heeded));
  bool over = answer == LSP_ANSWER_SKY && !lsp_walk.closed;
  if (!exactly && hit > s.tmin && hit < s.tmax) {
    over = true;
    if ((LSP_PARTS & LSP_PART_COVERAGE) != 0u) {
      LspTriangle tri = lsp_load_triangle(scene, lsp_load_plane_record(scene, plane));
      if (lsp_has_gaps(tri)) {
        /* As a Line Space's candidate that is there in part: the cell is traced exactly; from tables
         * alone the ray either meets the plane or goes on to the next cell. */
        exactly = (LSP_PARTS & LSP_PART_CELL_EXACT) != 0u && q.dial != LSP_DIAL_TABLES;
        over = !exactly && !lsp_passes(s, tri);
      }
    }
    if (over) {
      lsp_walk.best.t = hit;
      lsp_walk.best.triangle = plane;
      lsp_walk.best.flags = LSP_HIT_LINE_SPACE | (begins ? LSP_HIT_ORIGIN_INSIDE : 0u);
    }
  }
  if (exactly) {
    bool waits = lsp_walk.mode == LSP_WALK_WAITS && (lsp_walk.waiting != 0u || lsp_walk.step <= LSP_LAST_WAITING);
    if (!waits || lsp_walk.waiting == 0u) {
      lsp_walk.exact_cell = cell;
      lsp_walk.exact_t = t;
    }
    if (waits) {
      lsp_walk.waiting |= lsp_step_bit(lsp_walk.step - 1u);
    } else {
      lsp_walk.ref = index | LSP_LEAF_BIT;
    }
  }
  return over && !exactly;
}

/* To the first cell of the ray; where it begins in it, through it. Only here origin tables are asked: apart from the loop
 * over the others, which a device runs through with all its invocations. */
LSP_STEP void lsp_begin(LspScene scene, LspSetup s, LspQuery q) {
  LspCellGrid grid = lsp_load_header(scene).cells;
  LspCellRay r = lsp_cell_ray(grid, s);
  vec3 dims = lsp_cell_dims(grid);
  precise vec3 a = (vec3(0.0f, 0.0f, 0.0f) - r.origin) * r.inverse;
  precise vec3 b = (dims - r.origin) * r.inverse;
  vec3 first = vec3(lsp_min(a.x, b.x), lsp_min(a.y, b.y), lsp_min(a.z, b.z));
  vec3 last = vec3(lsp_max(a.x, b.x), lsp_max(a.y, b.y), lsp_max(a.z, b.z));
  float t_in = lsp_max(lsp_max(first.x, first.y), first.z);
  bool outside = t_in > s.tmin;
  lsp_walk.t_last = lsp_min(lsp_min(lsp_min(last.x, last.y), last.z), s.tmax);
  lsp_walk.t = outside ? t_in : s.tmin;
  lsp_walk.axis = !outside ? -1 : (t_in == first.x ? 0 : (t_in == first.y ? 1 : 2));
  vec3 p = lsp_cell_point(r, lsp_walk.t);
  lsp_walk.cell = lsp_cell_at(grid, p);
  lsp_walk.ref = lsp_walk.t < lsp_walk.t_last ? 0u : LSP_NONE;
  lsp_walk.exact_cell = lsp_walk.cell;
  lsp_walk.exact_t = lsp_walk.t;
  lsp_walk.step = 0u;
  lsp_walk.closed = false;
  lsp_walk.best = lsp_no_best(s);
  lsp_walk.any_hit = (q.flags & LSP_TRACE_ANY_HIT) != 0u;
  /* A ray that ends within the grid is short, and not many cells are there to spare it one that waits. */
  bool waits = lsp_walk.any_hit && lsp_walk.t_last < s.tmax && (q.dial >> 8u) != 0u;
  lsp_walk.mode = waits ? LSP_WALK_WAITS : LSP_WALK_CALLS;
  lsp_walk.waiting = 0u;
  lsp_walk.counts = lsp_no_counts();
  lsp_stack_ref[0] = lsp_walk.ref;
  ivec3 cell = lsp_walk.cell;
  if (outside || lsp_walk.ref == LSP_NONE) return;
  lsp_walk.step = 1u;
  lsp_walk.counts.nodes = 1u;
  uint word = lsp_load_cell_word(scene, (uint(cell.z) * grid.cells_y + uint(cell.y)) * grid.cells_x + uint(cell.x));
  bool filled = (word & LSP_CELL_FILLED) != 0u;
  LspCellPassage pass = lsp_cell_pass(r, cell, filled ? 0 : int(word & LSP_CELL_MAX_JUMP), lsp_walk.t);
  if (filled) {
    uint index = word & ~LSP_CELL_FILLED;
    vec3 corner = lsp_cell_corner(cell);
    uint face_out = 2u * uint(pass.axis_out) + lsp_ahead(r, pass.axis_out);
    LspCellLook look = lsp_cell_origin(grid, lsp_load_cell_origins(scene, index), p - corner, pass.to - corner,
                                       pass.axis_out, face_out);
    /* A ray that ends within the grid may miss what is beyond. */
    lsp_walk.closed = (LSP_PARTS & LSP_PART_CELL_EXACT) != 0u && q.dial != LSP_DIAL_TABLES && look.closed && lsp_walk.t_last < s.tmax;
    /* Where no surface is near its beginning there is no origin table: nobody knows what the far one loses. */
    uint loss = look.entry == LSP_NONE ? LSP_LOSS_UNKNOWN << LSP_LOSS_SHIFT : 0u;
    if (look.entry == LSP_NONE) look = lsp_cell_through(grid, index, r, cell, pass.to - corner, pass.axis_out, face_out);
    uint entry = LSP_ANSWER_EMPTY;
    if (look.entry != LSP_NONE) entry = lsp_load_entry(scene, look.entry);
    bool over = lsp_cell_answer(scene, s, q, r, index, entry | loss, look, cell, true, lsp_walk.t, pass.t_out);
    if (over) lsp_stack_ref[0] = LSP_NONE;
    if (over) lsp_walk.ref = LSP_NONE;
  }
  lsp_walk.cell = pass.next;
  lsp_walk.t = pass.t_out;
  lsp_walk.axis = pass.axis_out;
}

/* From cell to cell until a table answers, or a cell is to be traced exactly, or the ray is over.
 *
 * Where the ray entered the grid is not worked out here again: glslang's search for what `precise` concerns has no end
 * then (trace_passes.comp with addresses: minutes and 12 GB for half a second). Time it after a change to this. */
LSP_STEP void lsp_advance(LspScene scene, LspSetup s, LspQuery q) {
  LspCellGrid grid = lsp_load_header(scene).cells;
  LspCellRay r = lsp_cell_ray(grid, s);
  uint most = grid.cells_x + grid.cells_y + grid.cells_z;
  bool over = lsp_walk.best.triangle != LSP_NONE;
  while (!over && lsp_walk.ref == 0u && lsp_walk.step < most) {
    ivec3 cell = lsp_walk.cell;
    float t = lsp_walk.t;
    bool made_up = lsp_walk.mode == LSP_WALK_MAKES_UP && lsp_walk.waiting == 0u;
    over = made_up || !(t < lsp_walk.t_last) || uint(cell.x) >= grid.cells_x || uint(cell.y) >= grid.cells_y || uint(cell.z) >= grid.cells_z;
    if (over && lsp_walk.mode == LSP_WALK_WAITS && lsp_walk.waiting != 0u) {
      over = false;
      lsp_walk.mode = LSP_WALK_MAKES_UP;
      lsp_walk.step = uint(bitCount((lsp_walk.waiting & (~lsp_walk.waiting + 1u)) - 1u)); /* the first */
      t = lsp_walk.exact_t;
      cell = lsp_walk.exact_cell;
    } else if (over && lsp_walk.closed) {
      over = false;
      lsp_walk.closed = false;
      lsp_walk.mode = LSP_WALK_AGAIN;
      lsp_walk.step = 0u;
      t = s.tmin;
      cell = lsp_cell_at(grid, lsp_cell_point(r, t));
    }
    if (over) break;
    lsp_walk.step += 1u;
    lsp_walk.counts.nodes += 1u;
    uint word = lsp_load_cell_word(scene, (uint(cell.z) * grid.cells_y + uint(cell.y)) * grid.cells_x + uint(cell.x));
    bool filled = (word & LSP_CELL_FILLED) != 0u;
    LspCellPassage pass = lsp_cell_pass(r, cell, filled ? 0 : int(word & LSP_CELL_MAX_JUMP), t);
    if (lsp_walk.mode == LSP_WALK_MAKES_UP && lsp_walk.step <= LSP_LAST_WAITING) {
      uint bit = lsp_step_bit(lsp_walk.step - 1u);
      if (filled && (lsp_walk.waiting & bit) != 0u) {
        lsp_walk.ref = (word & ~LSP_CELL_FILLED) | LSP_LEAF_BIT;
        lsp_walk.exact_cell = cell;
        lsp_walk.exact_t = t;
      }
      lsp_walk.waiting &= ~bit;
    } else if (filled) {
      uint index = word & ~LSP_CELL_FILLED;
      vec3 corner = lsp_cell_corner(cell);
      LspCellLook look = lsp_cell_far(grid, index, lsp_cell_point(r, t) - corner, pass.to - corner, lsp_walk.axis,
                                      2u * uint(lsp_walk.axis) + 1u - lsp_ahead(r, lsp_walk.axis), pass.axis_out,
                                      2u * uint(pass.axis_out) + lsp_ahead(r, pass.axis_out));
      uint entry = LSP_ANSWER_EMPTY;
      if (look.entry != LSP_NONE) entry = lsp_load_entry(scene, look.entry);
      over = lsp_cell_answer(scene, s, q, r, index, entry, look, cell, false, t, pass.t_out);
    }
    lsp_walk.cell = pass.next;
    lsp_walk.t = pass.t_out;
    lsp_walk.axis = pass.axis_out;
  }
  if (over) lsp_stack_ref[0] = LSP_NONE;
  if (lsp_walk.ref == 0u) lsp_walk.ref = LSP_NONE;
}

/* Where a ray enters a box of a cell's tree, not before t_first; infinity where it misses it up to t_last. `unit` is
 * the box's unit along the ray, plus and minus are the cell's corner from the origin moved outwards. */
LSP_FN float lsp_cell_box(vec3 lo, vec3 hi, vec3 unit, vec3 plus, vec3 minus, float t_first, float t_last) {
  precise vec3 a = lo * unit + plus;
  precise vec3 b = hi * unit + minus;
  float t_in = lsp_max(lsp_max(lsp_min(a.x, b.x), lsp_min(a.y, b.y)), lsp_max(lsp_min(a.z, b.z), t_first));
  float t_out = lsp_min(lsp_min(lsp_max(a.x, b.x), lsp_max(a.y, b.y)), lsp_min(lsp_max(a.z, b.z), t_last));
  return t_in <= t_out ? t_in : LSP_INFINITY;
}

LSP_FN float lsp_byte(uint word, uint shift) { return float((word >> shift) & 0xFFu); }

/* Traces the cell of lsp_walk.ref exactly: its closest triangle, or any, between where the ray entered it and left it. */
LSP_STEP void lsp_test_leaf(LspScene scene, LspSetup s) {
  if ((LSP_PARTS & LSP_PART_CELL_EXACT) == 0u) return;
  LspCellGrid grid = lsp_load_header(scene).cells;
  LspFilledCell tree = lsp_load_cell_tree(scene, lsp_walk.ref & ~LSP_LEAF_BIT);
  /* Of a damaged file that may be any number; of a valid one no more than children can name. */
  uint most = tree.max_steps < LSP_CELL_LEAF_BIT ? tree.max_steps : LSP_CELL_LEAF_BIT;
  precise float reach = grid.margin / s.speed; /* along no axis more than the margin */
  s.tmin = lsp_max(s.tmin, lsp_walk.exact_t - reach);
  s.tmax = lsp_min(s.tmax, lsp_walk.t + reach);
  LspBest best = lsp_no_best(s);
  precise vec3 corner = lsp_vec3(grid.lo) - vec3(grid.margin, grid.margin, grid.margin) + lsp_cell_corner(lsp_walk.exact_cell) * grid.size;
  precise vec3 unit = s.inverse * grid.box_step;
  precise vec3 plus = (corner - s.origin_plus) * s.inverse;
  precise vec3 minus = (corner - s.origin_minus) * s.inverse;
  uint top = 1u;
  uint ref = tree.root;
  uint step = 0u;
  lsp_walk.counts.exact += 1u;
  while (ref != LSP_CELL_NO_CHILD) {
    while (ref < LSP_CELL_LEAF_BIT && step < most) {
      ++step;
      LspCellNode n = lsp_load_cell_node(scene, tree.node_first + ref);
      float t0 = lsp_cell_box(vec3(lsp_byte(n.box_0, 0u), lsp_byte(n.box_0, 8u), lsp_byte(n.box_0, 16u)),
                              vec3(lsp_byte(n.box_0, 24u), lsp_byte(n.box_1, 0u), lsp_byte(n.box_1, 8u)), unit, plus, minus, s.tmin, best.t);
      float t1 = lsp_cell_box(vec3(lsp_byte(n.box_1, 16u), lsp_byte(n.box_1, 24u), lsp_byte(n.box_2, 0u)),
                              vec3(lsp_byte(n.box_2, 8u), lsp_byte(n.box_2, 16u), lsp_byte(n.box_2, 24u)), unit, plus, minus, s.tmin, best.t);
      bool in0 = t0 <= best.t;
      bool in1 = t1 <= best.t;
      uint nearer = t0 <= t1 ? n.children & 0xFFFFu : n.children >> 16u;
      if (in0 && in1) {
        lsp_stack_ref[top] = t0 <= t1 ? n.children >> 16u : n.children & 0xFFFFu;
        top = top + 1u < LSP_CELL_STACK ? top + 1u : top;
      } else if (!in0 && !in1) {
        nearer = LSP_CELL_NO_CHILD;
        if (top > 1u) {
          --top;
          nearer = lsp_stack_ref[top];
        }
      }
      ref = nearer;
    }
    if (ref < LSP_CELL_LEAF_BIT || ref == LSP_CELL_NO_CHILD) break;
    uint first = tree.reference_first + (ref & (LSP_CELL_MAX_REFERENCES - 1u));
    uint count = ((ref >> LSP_CELL_LEAF_COUNT_SHIFT) & 3u) + 1u;
    lsp_walk.counts.triangles += count;
    for (uint i = 0u; i < count; ++i) best = lsp_triangle(scene, s, lsp_load_cell_reference(scene, first + i), best);
    ref = LSP_CELL_NO_CHILD;
    if (top > 1u && !(lsp_walk.any_hit && best.triangle != LSP_NONE)) {
      --top;
      ref = lsp_stack_ref[top];
    }
  }
  lsp_walk.counts.exact_nodes += step;
  if (best.triangle != LSP_NONE) lsp_walk.best = best;
  lsp_walk.ref = 0u; /* go on */
}

/* Look-ups are made on the way. */
LSP_STEP void lsp_look_up(LspScene, LspSetup, LspQuery) {}

LSP_STEP LspBest lsp_end(LspScene scene) {
  lsp_walk.best.complete = lsp_stack_ref[0] == LSP_NONE;
  /* So far a table's answer is a plane. */
  if ((lsp_walk.best.flags & LSP_HIT_LINE_SPACE) != 0u) lsp_walk.best.triangle = lsp_load_plane_record(scene, lsp_walk.best.triangle);
  return lsp_walk.best;
}
