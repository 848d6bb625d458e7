#!/usr/bin/env bash
# translate.sh SOURCE_DIR WORK_DIR GLSLC
#
# The shader include in other languages: what reads a scene over descriptors becomes HLSL for shader model 6.0, which
# compiles (by glslc, which knows the language), and Metal's, through SPIRV-Cross; what reads through addresses becomes
# Metal's. Exit 77: that is not here.
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
translate passes "$source/runtime/vulkan/trace_passes.comp"
translate wide "$source/runtime/vulkan/trace.comp" -DLSP_WIDE
translate instances "$source/runtime/vulkan/trace.comp" -DLSP_INSTANCES

# Addresses HLSL of SPIRV-Cross does not know.
"$glslc" -O --target-env=vulkan1.2 "${includes[@]}" -DLSP_INSTANCES -DLSP_ADDRESSES -o instances.spv "$source/runtime/vulkan/trace.comp"
spirv-cross instances.spv --msl --msl-version 20300 --output instances.metal
grep -q '^kernel void main0(' instances.metal
echo "instances through addresses: Metal $(wc -l <instances.metal) lines"

# Several scenes in one pipeline, by their numbers.
cat >several.comp <<'SHADER'
#version 460
#extension GL_GOOGLE_include_directive : require
#define LSP_INSTANCES
#include "lsp/lsp.glsl"
layout(local_size_x = 64) in;
layout(std430, set = 1, binding = 0) buffer Work { vec4 work[]; };
void main() {
  uint i = gl_GlobalInvocationID.x;
  LspScene scene = lsp_asset(floatBitsToUint(work[2u * i + 1u].w));
  LspRay ray = LspRay(work[2u * i].xyz, 0.0, work[2u * i + 1u].xyz, LSP_INFINITY);
  LspHit hit = lsp_trace(scene, ray, LSP_TRACE_APPROXIMATE);
  work[2u * i].w = lsp_occluded(scene, ray, LSP_TRACE_APPROXIMATE) ? hit.t + lsp_hit_offset(scene, hit) : 0.0;
}
SHADER
"$glslc" -O -g --target-env=vulkan1.1 "${includes[@]}" -o several.spv several.comp
# The buffer of instances is not read.
spirv-cross several.spv --reflect | grep -q '"LspInstanceBuffer"' && { echo "several scenes read instances"; exit 1; }
echo "several scenes in one shader"
