/* Parts of the traversal that few scenes need, for C, C++ and GLSL. lsp_vulkan_parts (lsp/lsp_vulkan.h) says which
 * ones a scene needs. A shader compiled without the others (LSP_PARTS, see lsp/lsp.glsl) is faster where a device
 * runs both sides of every branch: approximate rays on lavapipe 1.05 to 1.07 times in a BVH, 1.2 times in an NTree. */
#ifndef LSP_PARTS_H
#define LSP_PARTS_H

#define LSP_PART_BINARY 0x1u          /* Line Spaces without candidates */
#define LSP_PART_NORMAL_ANGLE 0x2u    /* header.normal_angle_cos is a limit */
#define LSP_PART_PLANE_TOLERANCE 0x4u /* header.plane_tolerance is not 0 */
#define LSP_PART_CELL_EXACT 0x8u      /* Cells: any dial but LSP_DIAL_TABLES; without it tables alone answer */
#define LSP_PART_COVERAGE 0x10u       /* triangles that are there in part: LSP_FEATURE_COVERAGE */

#endif
