// The tracer's text of BVHs and NTrees is compiled twice: without the part for triangles that are there in
// part, and by the files of partial/ with it. Scenes without such triangles pay nothing.
#ifndef LSP_VARIANT
#define LSP_PARTS (~LSP_PART_COVERAGE)
#define LSP_VARIANT solid
#endif
