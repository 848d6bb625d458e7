/* What lsp-view and its shaders tell one another, stated once, for C++ and GLSL. */
#ifndef LSP_VIEW_INTERFACE_H
#define LSP_VIEW_INTERFACE_H

#include "lsp/layout.h"

/* Of set 0 are the scene's buffers (LSP_BINDING_*); these are set 1, all storage buffers. */
#define VIEW_BINDING_FRAME 0      /* ViewFrame */
#define VIEW_BINDING_SUMS 1       /* vec4 a pixel: radiance, or heat, of all samples; how many they are */
#define VIEW_BINDING_VERTICES 2   /* ViewVertex, VIEW_SLICE_PIXELS of the eye, then as many of the bounce */
#define VIEW_BINDING_MATERIALS 3  /* LspMaterial */
#define VIEW_BINDING_TRIANGLES 4  /* uint a primitive: its LspTriangle, LSP_NONE: dropped */
#define VIEW_BINDING_EMITTERS 5   /* ViewEmitter */
#define VIEW_BINDING_STATISTICS 6 /* ViewStatistics of the exact half, then of the approximate one */
#define VIEW_BINDING_SHOWN 7      /* uint a pixel of the window, as its images have it */
#define VIEW_BINDING_FILES 8      /* ViewFile: one, or one an asset of instances */
#define VIEW_BINDING_COUNT 9

/* Pixels are worked on in slices of whole rows, at most so many pixels each: one submission a slice. */
#define VIEW_SLICE_PIXELS (1u << 17)
#define VIEW_GROUP_EDGE 8u /* pixels of a work group, along x and y */

/* What is shown. */
#define VIEW_LIGHT 0u   /* all light: direct, exactly traced, and one diffuse bounce */
#define VIEW_DIFFUSE 1u /* the bounce alone */
#define VIEW_AO 2u      /* ambient occlusion */
#define VIEW_HEAT 3u    /* steps of the bounce's rays */

#define VIEW_EXACT 0u /* halves */
#define VIEW_APPROXIMATE 1u

#define VIEW_EYE 0u /* vertices of paths */
#define VIEW_BOUNCE 1u

/* Lights. */
#define VIEW_SKY 0u
#define VIEW_SUN 1u
#define VIEW_LAMP 2u /* the scene's emitters or, without any, the lamp; the last */

/* Specialization constants besides those of the trace shader (lsp/interface.h), whose numbers end at 2. */
#define VIEW_CONSTANT_FLAGS 1 /* LSP_TRACE_*: a pipeline does one kind of trace */
#define VIEW_CONSTANT_PARTS 2 /* LSP_PART_* */

/* clang-format off */
LSP_BEGIN(ViewFrame)
  LSP_VEC3 eye;
  LSP_FLOAT half_height; /* of the picture at distance 1 */
  LSP_VEC3 right;
  LSP_UINT width; /* of the picture that is traced, in pixels */
  LSP_VEC3 up;
  LSP_UINT height;
  LSP_VEC3 forward;
  LSP_UINT sample_number;
  LSP_VEC3 sun_direction;
  LSP_FLOAT sun_radius; /* rad */
  LSP_VEC3 sun_irradiance;
  LSP_FLOAT sky_brightness;
  LSP_VEC3 lamp_position;
  LSP_FLOAT lamp_radius;
  LSP_VEC3 lamp_intensity; /* black: no lamp */
  LSP_UINT emitters;
  LSP_UINT effect;
  LSP_UINT dial;
  LSP_FLOAT lod;
  LSP_FLOAT ao_reach;
  LSP_UINT scale; /* pixels of the window along an edge of one that is traced */
  LSP_UINT window_width;
  LSP_UINT window_height;
  LSP_UINT split;       /* the window's columns left of it are exact */
  LSP_FLOAT exposure;   /* factor */
  LSP_FLOAT heat_white; /* steps */
  LSP_UINT blue_first;  /* the window's images are BGRA, not RGBA */
  LSP_UINT z_up;        /* z, not y, points to the sky */
  LSP_UINT instance_count;
  LSP_UINT reserved0;
  LSP_UINT reserved1;
  LSP_UINT reserved2;
LSP_END(ViewFrame)

/* Where what belongs to a file begins in the buffers that all of them share. */
LSP_BEGIN(ViewFile)
  LSP_UINT first_primitive; /* of VIEW_BINDING_TRIANGLES */
  LSP_UINT primitives;
  LSP_UINT first_material; /* of VIEW_BINDING_MATERIALS */
  LSP_UINT materials;
LSP_END(ViewFile)

/* A surface that a path has come to. */
LSP_BEGIN(ViewVertex)
  LSP_VEC3 origin;           /* of rays that leave it: lsp_hit_offset off the surface */
  LSP_UINT alive;            /* 0: the path ended before */
  LSP_VEC3 geometric_normal; /* unit, on the side the ray came from; the shading normal, too */
  LSP_UINT reserved0;
  LSP_VEC3 shading_normal;
  LSP_UINT reserved1;
  LSP_VEC3 weight; /* what of light that arrives here reaches the eye */
  LSP_UINT reserved2;
LSP_END(ViewVertex)

LSP_BEGIN(ViewEmitter)
  LSP_VEC3 corner;
  LSP_FLOAT cumulative; /* of area times luminance, up to and with this one, over the total */
  LSP_VEC3 edge1;
  LSP_FLOAT pdf; /* per area */
  LSP_VEC3 edge2;
  LSP_UINT reserved0;
  LSP_VEC3 radiance;
  LSP_UINT reserved1;
LSP_END(ViewEmitter)

/* Of one slice. */
LSP_BEGIN(ViewStatistics)
  LSP_UINT rays;       /* of indirect light */
  LSP_UINT incomplete; /* of these cut short by the device: left dark */
  LSP_UINT steps;      /* with VIEW_HEAT */
  LSP_UINT reserved;
LSP_END(ViewStatistics)

/* Push constants: columns [first_column, first_column + columns) of rows [first_row, first_row + rows), the
 * slice's. */
LSP_BEGIN(ViewRegion)
  LSP_UINT first_column;
  LSP_UINT columns;
  LSP_UINT first_row;
  LSP_UINT rows;
  LSP_UINT part;   /* VIEW_EXACT, VIEW_APPROXIMATE: whose statistics it adds to */
  LSP_UINT vertex; /* VIEW_EYE, VIEW_BOUNCE: where light.comp looks for light */
  LSP_UINT light;  /* VIEW_SKY, VIEW_SUN, VIEW_LAMP: which it looks for */
LSP_END(ViewRegion)

#ifdef __cplusplus
static_assert(sizeof(ViewFrame) == 192 && sizeof(ViewVertex) == 64 && sizeof(ViewEmitter) == 64);
static_assert(sizeof(ViewStatistics) == 16 && sizeof(ViewRegion) == 28 && sizeof(ViewFile) == 16);
#endif

#endif
