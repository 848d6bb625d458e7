#define LSP_LOOPS kBvhLoops
#include "trace_loops.inc"
