#!/usr/bin/env bash
# Installs what is missing, builds, runs every test, and says what passed, failed and was skipped.
#
#   ./tests/run.sh [--no-asan] [--jobs N]
#
# Exit 0 only if everything built and every test that could run passed.
set -euo pipefail
cd "$(dirname "$0")/.."

with_asan=1
jobs=$(nproc)
while [ $# -gt 0 ]; do
  case "$1" in
    --no-asan) with_asan=0 ;;
    --jobs) jobs=$2; shift ;;
    --help) sed -n '2,6s/^# \{0,1\}//p' "$0"; exit 0 ;;
    *) echo "run.sh: unknown option $1, see --help" >&2; exit 1 ;;
  esac
  shift
done

started=$SECONDS
# What only the tests need: Debian packages are made, with manual pages; a project is built with Make; shaders become
# HLSL and Metal's language; sources are formatted; a bake is divided by GNU parallel; SPEC.md has a reader in Python. And where nothing of the kind is
# there: the second reader runs on Node.js, the fuzzers are built with Clang.
extra=(clang-format-14 doxygen dpkg-dev file help2man make parallel python3-numpy spirv-cross xvfb)
command -v npm >/dev/null || extra+=(nodejs npm)
command -v clang++-14 >/dev/null || extra+=(clang-14)
compgen -G '/usr/lib/llvm-14/lib/clang/*/lib/linux/libclang_rt.fuzzer-*.a' >/dev/null || extra+=(libclang-rt-14-dev)
./samples/setup.sh "${extra[@]}"

# ccache makes the second run short; without it everything still builds.
launcher=()
if command -v ccache >/dev/null; then
  launcher=(-DCMAKE_C_COMPILER_LAUNCHER=ccache -DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
fi

summary=()
failed=0

# run_preset PRESET BUILD_TARGETS... -- CTEST_ARGUMENTS...
run_preset() {
  local preset=$1 targets=() log count skipped broken
  shift
  while [ "$1" != -- ]; do targets+=("$1"); shift; done
  shift
  echo "== $preset: configure and build"
  cmake --preset "$preset" "${launcher[@]}"
  cmake --build --preset "$preset" -j "$jobs" ${targets[@]+--target "${targets[@]}"}
  echo "== $preset: test"
  log="build/$preset/tests.log"
  if ! ctest --preset "$preset" -j "$jobs" "$@" 2>&1 | tee "$log"; then failed=1; fi
  count=$(grep -cE '^ *[0-9]+/[0-9]+ Test +#' "$log" || true)
  if [ "$count" -eq 0 ]; then
    echo "run.sh: $preset: no test ran" >&2
    failed=1
  fi
  skipped=$(grep -cE '\*\*\*Skipped' "$log" || true)
  broken=$(grep -cE '\*\*\*(Failed|Timeout|Not Run|Exception)|Subprocess aborted' "$log" || true)
  summary+=("$preset: $count tests, $skipped skipped, $broken failed")
  while IFS= read -r line; do summary+=("    skipped: $line"); done < <(
    sed -nE 's/^ *[0-9]+\/[0-9]+ Test +#[0-9]+: ([^ ]+) .*\*\*\*Skipped.*/\1/p' "$log")
}

run_preset release --
if [ "$with_asan" = 1 ]; then
  # Everything that reads untrusted bytes, once more under the address and undefined-behaviour sanitizers.
  run_preset asan parser_tests -- -L parser
  # What is called from many threads, once more under the thread sanitizer.
  run_preset tsan thread_tests -- -L threads
fi

echo
echo "== summary after $(((SECONDS - started) / 60)) min $(((SECONDS - started) % 60)) s"
printf '%s\n' "${summary[@]}"
if [ "$failed" != 0 ]; then
  echo "FAILED"
  exit 4
fi
echo "all passed"
