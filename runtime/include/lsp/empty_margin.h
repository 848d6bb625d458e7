/* How far from its shafts a conservative Line Space looks, for the baker and for the tracers: C, C++ and GLSL.
 *
 * A clear bit of a conservative Line Space proves that no triangle of its node comes within
 *
 *   m = 2 (LSP_EMPTY_EXTENT * extent + LSP_EMPTY_REACH * reach)       along any axis
 *
 * of any straight line through the shaft's two patches, inside the box or outside; extent is the largest edge of
 * the scene's box (LspHeader.bounds_*), reach its largest coordinate in size. So a ray that takes the shaft hits
 * none of these triangles, rounding included, while 2 err <= m, with its err of lsp/traverse.h. Proof, u = 2^-24,
 * R as there, a = max|o|, R >= extent / 2. Let a cell of an NTree, or a node, be the box; its sides lie within 3.1 R
 * of the origin along every axis (the cube of an NTree reaches an edge beyond a flat scene's box at most).
 *
 *   1. lsp_pass computes t_in and t_out; let p(t) be the exact ray. A slab plane is off by 3 u 3.1 R along its axis,
 *      so that with t_in <= t_out p(t_in) and p(t_out) lie inside the box grown by 9.3 u R, and within that of the
 *      plane of their face.
 *   2. The points are rounded by u 3.1 R (product) and u (a + 3.1 R) (sum); their patches' coordinates by four
 *      roundings of at most the box's edge, 4 u 2.1 R. Clamping moves a point back by what it was off. So p(t_in) and
 *      p(t_out) lie within 24 u R + u a of the patches chosen, along every axis.
 *   3. A triangle that lsp_triangle lets the ray hit comes within 5 u R of it: q = p(t) + e.
 *   4. p + e then is a line through q that passes both patches grown by 29 u R + u a < 32 u R + 8 u a = 2 err <= m.
 *
 * That the line goes on outside the box matters where a triangle does: a tracer that descends meets it there too,
 * and skipping must not even change which of two equal hits comes first. A triangle inside the box by m on every
 * side meets p between t_in and t_out only.
 *
 * Rays from within about two extents of the scene's box meet the condition; from further away nothing is skipped.
 */
#ifndef LSP_EMPTY_MARGIN_H
#define LSP_EMPTY_MARGIN_H

#define LSP_EMPTY_EXTENT 3.8146973e-6f /* 2^-18 */
#define LSP_EMPTY_REACH 4.7683716e-7f  /* 2^-21 */

#endif
