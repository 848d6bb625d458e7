#!/usr/bin/env bash
# run.sh SOURCE_DIR BIN_DIR WORK_DIR GUIDE_CPU
#
# The commands of the guides, in their order, each guide's in a folder of its own; GUIDE_CPU is INTEGRATION.md's program. And
# every figure of TUNING.md is one of RESULTS.md.
set -euo pipefail
source=$1 bin=$2 work=$3 program=$4
extract=$source/tests/runtime/guides/extract.awk
rm -rf "$work"
mkdir -p "$work/integration/include/lsp" "$work/tuning"
export PATH="$bin:$PATH"
blocks() { awk -v want="$2" -f "$extract" "$source/runtime/$1.md"; }
run() { # run GUIDE INFO: the blocks, or what is wrong with them
  local commands
  commands=$(blocks "$1" "$2")
  [ -n "$commands" ] || { echo "$1.md has no commands in blocks '$2'"; exit 1; }
  bash -euo pipefail -x -c "$commands" || { echo "$1.md: a command failed"; exit 1; }
}

cd "$work/integration"
cp "$source"/runtime/include/lsp/* "$source"/format-spec/include/lsp/* include/lsp/
blocks INTEGRATION glsl >ao.comp
blocks INTEGRATION "glsl instances" >instances.comp
run INTEGRATION sh
if command -v spirv-cross >/dev/null; then
  run INTEGRATION "sh spirv-cross"
  # What the table of bindings says.
  for line in 't0, space0' 't2, space0' 't0, space1' 'RWByteAddressBuffer.*u1, space1' \
    '^cbuffer Push$' 'ifndef SPIRV_CROSS_CONSTANT_ID_1$' 'numthreads(64, 1, 1)'; do
    grep -q "$line" ao_cells.hlsl || { echo "ao_cells.hlsl has no $line"; exit 1; }
  done
  grep '^kernel void main0(' ao_cells.metal | tr ',' '\n' >kernel
  for line in 'Push&.*buffer(0)' 'LspHeaderBuffer&.*buffer(1)' 'LspTriangleBuffer&.*buffer(3)' 'Rays&.*buffer(13)' \
    'Open&.*buffer(14)'; do
    grep -q "$line" kernel || { echo "the kernel of ao_cells.metal has no $line"; cat kernel; exit 1; }
  done
  [ -z "$(grep -o 'buffer([0-9]*)' kernel | sort | uniq -d)" ] || { echo "buffers of Metal share numbers"; cat kernel; exit 1; }
  grep -q 'function_constant(1)' ao_cells.metal
else
  echo "without spirv-cross"
fi

# The commands of CMake, in a project that holds lsp.
mkdir engine
cp ao.comp engine
echo 'int main(void) { return 0; }' >engine/main.c
{
  echo 'cmake_minimum_required(VERSION 3.25)'
  echo 'project(engine LANGUAGES C CXX)'
  echo "add_subdirectory($source lsp)"
  echo 'add_executable(engine main.c)'
  echo 'target_link_libraries(engine PRIVATE lsp::runtime)'
  blocks INTEGRATION cmake
} >engine/CMakeLists.txt
cmake -G Ninja -S engine -B engine/build >engine/log && cmake --build engine/build --target ao_cells.spv >>engine/log ||
  { cat engine/log; echo "INTEGRATION.md: its shader cannot be built by CMake"; exit 1; }
cmp engine/build/ao_cells.spv ao_cells.spv || { echo "INTEGRATION.md: CMake builds another shader"; exit 1; }

"$program" room.lsp | tee said
grep -q '^256 rays went on, [1-9]' said && grep -q '^hits: [1-9]' said || { echo "INTEGRATION.md: its program meets nothing"; exit 1; }

cd "$work/tuning"
run TUNING sh

figures=$(grep -oE '[0-9][0-9.,]*(x| %| MB| s\b)' "$source/runtime/TUNING.md" | sort -u)
[ "$(wc -l <<<"$figures")" -ge 30 ] || { echo "TUNING.md has hardly a figure"; exit 1; }
missing=0
while IFS= read -r figure; do
  # In a table or a list of RESULTS.md the unit may stand once for several.
  number=${figure%%[x ]*}
  if ! grep -qF "$figure" "$source/tests/bench/RESULTS.md" && ! grep -qE "(^|[^0-9.])${number//./\\.}([ ,x;%]|$)" "$source/tests/bench/RESULTS.md"; then
    echo "TUNING.md: $figure is not in RESULTS.md"
    missing=1
  fi
done <<<"$figures"
exit $missing
