#!/usr/bin/env bash
# Runs the fuzzers of the format one after the other and says what they did.
#
#   run.sh BUILD-FOLDER SECONDS [SEED]
#
# Exit 3 when there is a finding, whose log is shown. SEED makes a run
# repeatable, up to where its time ends; without it every run goes another way.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../../.." && pwd)
build=$1
seconds=$2
seed=${3:-0}
work=$build/fuzz-format
findings=0
for name in open trace packed; do
  mkdir -p "$work/corpus-$name"
  log=$work/$name.log
  LLVM_PROFILE_FILE="$work/$name.profraw" "$build/bin/fuzz_format_$name" -max_total_time="$seconds" -seed="$seed" -timeout=10 \
    -max_len=12288 -rss_limit_mb=3000 -dict="$here/lsp.dict" -print_final_stats=1 -artifact_prefix="$work/$name-" \
    "$work/corpus-$name" "$root"/format-spec/corpus/*/valid "$root"/format-spec/corpus/*/invalid >"$log" 2>&1 ||
    { findings=1; echo "fuzz_format_$name: FINDING, see $log"; tail -n 60 "$log" | cut -c1-4000; }
  executions=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
  coverage=$(grep -oE 'cov: [0-9]+ ft: [0-9]+' "$log" | tail -1)
  echo "fuzz_format_$name: $executions executions, $coverage"
done
# How much of the validator, the loader and the tracer was reached.
for suffix in -14 ''; do
  if command -v "llvm-profdata$suffix" >/dev/null; then
    "llvm-profdata$suffix" merge -o "$work/all.profdata" "$work"/*.profraw
    "llvm-cov$suffix" report "$build/bin/fuzz_format_open" -object "$build/bin/fuzz_format_trace" \
      -object "$build/bin/fuzz_format_packed" -instr-profile="$work/all.profdata" \
      "$root/format-spec/src" "$root/runtime" 2>/dev/null
    break
  fi
done
[ "$findings" = 0 ] || exit 3
