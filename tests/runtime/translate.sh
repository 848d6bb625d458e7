#!/usr/bin/env bash
# translate.sh SOURCE_DIR WORK_DIR GLSLC
#
# The shader include in other languages: what reads a scene over descriptors becomes HLSL for shader model 6.0, which
# compiles (by glslc, which knows the language), and Metal's, through SPIRV-Cross; instances become Metal's. Exit 77: that
# is not here.
set -euo pipefail
source=$1 work=$2 glslc=$3
if ! command -v spirv-cross >/dev/null; then
  echo "skipped: spirv-cross is missing (Debian: spirv-cross)"
  exit 77
fi
mkdir -p "$work"
cd "$work"
includes=(-I "$source/runtime/include" -I "$source/format-spec/include")

translate() { # NAME SHADER DEFINES...
  local name=$1 shader=$2
  shift 2
  "$glslc" -O --target-env=vulkan1.1 "${includes[@]}" "$@" -o "$name.spv" "$shader"
  spirv-cross "$name.spv" --hlsl --shader-model 60 --output "$name.hlsl"
  "$glslc" -x hlsl -fshader-stage=compute --target-env=vulkan1.1 -o "$name.hlsl.spv" "$name.hlsl"
  spirv-cross "$name.spv" --msl --msl-version 20000 --output "$name.metal"
  grep -q '^kernel void main0(' "$name.metal"
  echo "$name: HLSL $(wc -l <"$name.hlsl") lines, $(grep -c ' : register(' "$name.hlsl") buffers; Metal $(wc -l <"$name.metal") lines"
}
translate bvh "$source/runtime/vulkan/trace.comp"
translate ntree "$source/runtime/vulkan/trace.comp" -DLSP_NTREE
translate cells "$source/runtime/vulkan/trace.comp" -DLSP_CELLS
translate wide "$source/runtime/vulkan/trace.comp" -DLSP_WIDE

# Instances are read through addresses, which HLSL of SPIRV-Cross does not know.
"$glslc" -O --target-env=vulkan1.2 "${includes[@]}" -DLSP_INSTANCES -o instances.spv "$source/runtime/vulkan/trace.comp"
spirv-cross instances.spv --msl --msl-version 20300 --output instances.metal
grep -q '^kernel void main0(' instances.metal
echo "instances: Metal $(wc -l <instances.metal) lines"
