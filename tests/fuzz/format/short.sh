#!/usr/bin/env bash
# The fuzzers' short run for every test run: builds them with Clang beside the other builds and gives each a few
# seconds, from the same seed and the corpus alone, so that one run of the tests is like the next; findings are looked
# for by run.sh over hours. Few rays at a time are traced, which vector lanes have no part in.
#
#   short.sh SOURCE-FOLDER BUILD-FOLDER SECONDS
#
# Exit 77 (skipped) where Clang or its fuzzer library is missing.
set -euo pipefail
source=$1
build=$2
seconds=$3
clang=$(command -v clang++-14 || command -v clang++ || true)
if [ -z "$clang" ]; then
  echo "SKIPPED: clang++ is not installed (packages clang-14, libclang-rt-14-dev)"
  exit 77
fi
mkdir -p "$build"
echo 'extern "C" int LLVMFuzzerTestOneInput(const unsigned char*, unsigned long) { return 0; }' >"$build/probe.cpp"
if ! "$clang" -fsanitize=fuzzer,address "$build/probe.cpp" -o "$build/probe" 2>/dev/null; then
  echo "SKIPPED: $clang has no libFuzzer (package libclang-rt-14-dev)"
  exit 77
fi
launcher=()
if command -v ccache >/dev/null; then
  launcher=(-DCMAKE_C_COMPILER_LAUNCHER=ccache -DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
fi
cmake -S "$source" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo -DCMAKE_CXX_COMPILER="$clang" \
  -DCMAKE_CXX_FLAGS_RELWITHDEBINFO=-O1 -DLSP_SIMD=OFF \
  -DCMAKE_C_COMPILER="${clang/clang++/clang}" "${launcher[@]}" >"$build/configure.log" 2>&1 ||
  { tail -20 "$build/configure.log"; exit 4; }
cmake --build "$build" --target fuzz_format >"$build/build.log" 2>&1 || { tail -40 "$build/build.log"; exit 4; }
rm -rf "$build"/fuzz-format/corpus-*
exec "$source/tests/fuzz/format/run.sh" "$build" "$seconds" 1
