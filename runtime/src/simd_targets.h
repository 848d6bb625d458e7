// What Highway compiles for, and whether this CPU runs it: of the library's sources with vectors.
//
// Of Highway headers alone are used: what its library holds is the choice of a target, made with the
// functions below. The targets are these, and the one without vectors that Highway wants to have. Under
// sanitizers and without optimisation, where each takes long to compile, one stands for all: the same text.
#pragma once

#define HWY_IS_DEBUG_BUILD 0
#if defined(LSP_INSTRUMENTED) || !defined(__OPTIMIZE__)
#define HWY_DISABLED_TARGETS (~(HWY_AVX2 | HWY_NEON | HWY_EMU128 | HWY_SCALAR))
#else
#define HWY_DISABLED_TARGETS (~(HWY_AVX3 | HWY_AVX2 | HWY_SSE4 | HWY_NEON | HWY_EMU128 | HWY_SCALAR))
#endif

namespace lsp {

#if defined(__x86_64__) || defined(__i386__)
inline bool has_avx3() {
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
         __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") &&
         __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi2") && __builtin_cpu_supports("fma");
}
inline bool has_avx2() {
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2") &&
         __builtin_cpu_supports("fma");
}
inline bool has_sse4() { return __builtin_cpu_supports("sse4.2") && __builtin_cpu_supports("popcnt"); }
#endif
inline bool has_neon() { return true; }

// The first of a table (simd_loops.inc) that this CPU runs; null: none.
template <class Loop>
const Loop* best_here(const Loop* loops) {
  for (; loops->name != nullptr; ++loops)
    if (loops->runs_here()) return loops;
  return nullptr;
}

}  // namespace lsp
