#define LSP_NTREE
#define LSP_LOOPS kNTreeLoops
#include "trace_loops.inc"
