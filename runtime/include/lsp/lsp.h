/* liblsp: open an .lsp file and trace rays against it.
 *
 * The library allocates nothing while it opens or traces, starts no threads, throws nothing and keeps no
 * global state. Every function may be called from any thread; a scene is read-only after lsp_open.
 *
 * The bytes of a file may be hostile. lsp_open checks everything that it and the tracer rely on to stay
 * inside the bytes given; lsp_trace checks every index that it follows and bounds its loops by the header's
 * declared limits, so that a damaged file gives wrong hits at worst. Use lsp-validate to know that a file is
 * good.
 */
#ifndef LSP_LSP_H
#define LSP_LSP_H

#include <stddef.h>
#include <stdint.h>

#include "lsp/export.h"
#include "lsp/interface.h"
#include "lsp/version.h"

#ifdef __cplusplus
extern "C" {
#endif

/* LSP_LIBRARY_VERSION of the library that is linked. It fits this header where major and minor are the
 * header's. */
LSP_API uint32_t lsp_version(void);
/* What a function answers. Other numbers may come. */
typedef enum lsp_status {
  LSP_OK = 0,
  LSP_ERROR_FILE = 2,        /* the file cannot be read */
  LSP_ERROR_INVALID = 3,     /* bytes that are no valid .lsp file, a transform without an inverse, an option
                                that is no number or out of its range */
  LSP_ERROR_UNSUPPORTED = 5, /* a version, feature or section this library does not know, or a packed file */
  LSP_ERROR_LIMIT = 6,       /* a limit was exceeded: a buffer given is too small, a range too large */
} lsp_status;

/* A status in a few words, for logs: "the file cannot be read". Of any value; it lives as long as the
 * program. What was wrong in particular is in lsp_error. */
LSP_API const char* lsp_status_string(lsp_status status);
/* Why a function failed, written only by those that take one; LSP_OK and an empty message on success. */
typedef struct lsp_error {
  lsp_status status; /* the one that was returned */
  uint64_t offset;   /* byte offset in the file of what is wrong, 0 where there is none */
  char message[192]; /* what is wrong and what to do, zero-terminated */
} lsp_error;

/* ---- files ---- */

/* A file mapped read-only. `bytes` is page-aligned. */
typedef struct lsp_mapping {
  const void* bytes; /* NULL: nothing is mapped */
  uint64_t size;     /* of the file, in bytes */
} lsp_mapping;

/* Maps the file at `path`. On success the caller owns the mapping and ends it with lsp_unmap_file. `error`
 * may be NULL here and everywhere below. */
LSP_API lsp_status lsp_map_file(const char* path, lsp_mapping* mapping, lsp_error* error);
LSP_API void lsp_unmap_file(lsp_mapping* mapping); /* clears it, too; an empty one is left alone */

/* Gives the memory back that pages of the mapping take in this process, and keeps the mapping: scenes stay
 * open, and what is read of them afterwards comes in again. For a file that was uploaded to a device, of
 * which the header alone is asked for from then on, or whose rays rest. */
LSP_API void lsp_release_pages(const lsp_mapping* mapping);

/* Sections a file may have at most; lsp_open compares each with all others. */
#define LSP_MAX_SECTIONS 256u

/* ---- scenes ---- */

/* A view of an open file: pointers into the caller's bytes, nothing owned. Arrays that the file does not
 * have, or that were not asked for, are NULL with a count of 0 in the header's sense. */
typedef struct lsp_scene {
  const void* bytes;          /* of the whole file, the caller's */
  uint64_t size;              /* in bytes */
  const LspHeader* header;    /* at bytes */
  const LspSection* sections; /* header->section_count of them */
  /* One pointer a section (lsp/sections.def): nodes or, of an NTree, grid, cells, references; of cells
   * besides nodes cell_words, filled_cells, entries, planes, plane_records, splits, cell_nodes,
   * cell_references; triangles, normals, materials; line_spaces, bit_words, candidates. */
#define LSP_ARRAY_SECTION(Name, TYPE, code, Element, flag, base, feature, owed, member, ...) \
  const Element* member;
#include "lsp/sections.def"
} lsp_scene;

/* Opens the raw (not packed) file in bytes[0, size). `bytes` must be 16-byte aligned and outlive `scene`.
 * Touches the header, the section table and nothing else: the cost does not depend on the file's size, and
 * hashes are not computed (lsp-validate does). A packed file is LSP_ERROR_UNSUPPORTED: unpack it first. */
LSP_API lsp_status lsp_open(const void* bytes, uint64_t size, lsp_scene* scene, lsp_error* error);

/* What positions in the scene, in rays and in hits are relative to, x y z in the input's space: not zero
 * where single precision would have moved vertices. */
LSP_API void lsp_scene_origin(const lsp_scene* scene, double origin[3]);

/* Raw and packed form. header.alignment states the alignment of the raw form, in packed files too. A file
 * with any compressed section is packed: its sections start at multiples of 256 and its length is padded to
 * 256. In the raw form that lsp_unpack writes, the sections follow the table in its order, each at the next
 * multiple of header.alignment, and the length is padded to it; everything between is zero. Content hash and
 * features are the same in both, header_hash is recomputed. Packing a raw file of that layout and unpacking
 * it gives the same bytes again. */

/* Size of the raw form of the packed or raw file in bytes[0, size), in bytes. `bytes` must be 16-byte aligned
 * and may be hostile: a size that its stored bytes cannot hold is refused, but bound what you allocate. */
LSP_API lsp_status lsp_unpacked_size(const void* bytes, uint64_t size, uint64_t* unpacked, lsp_error* error);

/* Writes the raw form of the file into `out`, 16-byte aligned, exactly lsp_unpacked_size bytes, not
 * overlapping `bytes`. Header, table and every section are checked against their hashes. After an error `out`
 * holds nothing of use. zstd allocates its working memory here; this is the only function of the library that
 * allocates. Of a library built without LSP_PACKED it is LSP_ERROR_UNSUPPORTED. */
LSP_API lsp_status lsp_unpack(const void* bytes, uint64_t size, void* out, uint64_t out_size,
                              lsp_error* error);

/* ---- tracing on the CPU ---- */

#ifdef __cplusplus
#define LSP_DEFAULT(value) = value /* of a member in C++; C has none */
#else
#define LSP_DEFAULT(value)
#endif

/* All zero: exact, closest hits. A flag or a quality that the library does not know is refused
 * (LSP_ERROR_UNSUPPORTED), and so is a lod or max_loss out of its range (LSP_ERROR_INVALID). */
typedef struct lsp_trace_options {
  uint32_t flags; /* LSP_TRACE_* */
  float lod;      /* theta, finite, from 0 on: stop at a Line Space once its box's diagonal is under lod *
                     distance; 0: deepest only */
  uint32_t quality LSP_DEFAULT(0); /* of cells: LSP_QUALITY_*, 0: balanced */
  float max_loss LSP_DEFAULT(0);   /* with LSP_TRACE_MAX_LOSS: where answers of cells lose more, about, in per
                       cent, the cell is traced exactly: 0, none is heeded, to 100, tables alone */
} lsp_trace_options;
#undef LSP_DEFAULT

/* The dial that the options ask for: the quality's, which the file states, or max_loss's. LSP_DIAL. */
LSP_API uint32_t lsp_dial(const lsp_scene* scene, const lsp_trace_options* options);

/* Sums over the rays traced. */
typedef struct lsp_trace_counts {
  uint64_t rays;    /* traced, invalid ones included */
  uint64_t invalid; /* rays with a non-finite component, a zero direction or tmin > tmax: misses */
  uint64_t hits;    /* rays that met something */
  uint64_t
      nodes; /* LspNode visited (two boxes each); NTree and cells: cells stepped through, empty ones too */
  uint64_t shafts;      /* Line Space look-ups */
  uint64_t triangles;   /* triangles tested exactly */
  uint64_t splits;      /* cells: look-ups that found a split */
  uint64_t exact;       /* cells: exact traces of one cell */
  uint64_t exact_nodes; /* cells: LspCellNode visited in these */
} lsp_trace_counts;

/* Adds `more` to *sum, field by field: of threads, or of parts of a set of rays. */
LSP_API void lsp_add_counts(lsp_trace_counts* sum, const lsp_trace_counts* more);

/* Traces rays[0, count) into hits[0, count), in this thread, with some 20 KiB of its stack, 40 KiB for
 * any-hit rays, 50 KiB where the scene has cells. Adds to *counts unless it is NULL. Hand it many rays at
 * once: approximate ones are traced in groups of 16, so that while one waits for memory the others go on; of
 * cells, where nothing is counted, 128 in vector lanes, exact closest ones as well where a vector has 16,
 * unless scene->cell_references is NULL: then nothing of cells is read. Exact any-hit rays of a file with
 * cells or wide nodes go down the tree 32 together, those that begin near each other of every 4,096.
 * LSP_ERROR_UNSUPPORTED when the file lacks what the options need: an exact tree; and when this library does
 * not know what they ask for; LSP_ERROR_INVALID where a number of them is out of its range: nothing is traced
 * then. A file without Line Spaces (a scene too small to need them) answers approximate traces exactly. */
LSP_API lsp_status lsp_trace(const lsp_scene* scene, const lsp_trace_options* options, const LspRay* rays,
                             LspHit* hits, uint64_t count, lsp_trace_counts* counts, lsp_error* error);

/* How far from a hit a ray that goes on from it should begin: along the unit geometric normal, on the side
 * that the ray came from; in the scene's units. More for a hit that a table answered, whose plane may lie
 * behind the surface: a ray that began there would meet the surface at once. In shaders lsp_hit_offset(scene,
 * hit). */
LSP_API float lsp_hit_offset(const lsp_scene* scene, const LspHit* hit);

#ifdef __cplusplus
}
#endif

#endif /* LSP_LSP_H */
