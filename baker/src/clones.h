// Loops compiled for several instruction sets, of which the loader chooses: the same arithmetic for each
// (nothing is contracted), only more of it at a time.
#pragma once

// A sanitizer's run time is not up yet when the loader chooses.
#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__)
#define LSP_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define LSP_CLONES
#endif
