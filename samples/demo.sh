#!/usr/bin/env bash
# From nothing to indirect light: installs what is missing, builds, bakes, validates, renders and compares.
#
#   ./samples/demo.sh            the procedural atrium
#   ./samples/demo.sh MESH...    your own mesh: .gltf .glb .obj .ply .stl .off
#
# Writes out/demo/: the .lsp file, exact.png, approx.png, difference.png and report.html. Renders through Vulkan
# (lavapipe where there is no GPU), on the CPU where there is no Vulkan device at all.
set -euo pipefail
case "${1:-}" in
  -h | --help) sed -n '2,8s/^# \{0,1\}//p' "$0"; exit 0 ;;
  -*) echo "demo.sh: unknown option $1, see --help" >&2; exit 1 ;;
esac
meshes=()
for mesh in "$@"; do
  if [ ! -r "$mesh" ]; then
    echo "demo.sh: $mesh: cannot be read; check the path" >&2
    exit 2
  fi
  meshes+=("$(realpath "$mesh")")
done
cd "$(dirname "$0")/.."
say() { printf '\n== %s\n' "$*"; }

./samples/setup.sh

say "building"
launcher=()
if command -v ccache >/dev/null; then
  launcher=(-DCMAKE_C_COMPILER_LAUNCHER=ccache -DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
fi
build=build/release
cmake --preset release "${launcher[@]}" >/dev/null
cmake --build --preset release --target \
  lsp-sample-scene lsp-bake lsp-validate lsp-render lsp-compare lsp-demo-report
bin=$PWD/$build/bin

out=out/demo
mkdir -p "$out"
rm -f "$out"/{curve,fast,accurate,compare,difference}*
view=()
light=()
if [ ${#meshes[@]} -eq 0 ]; then
  say "making the scene"
  "$bin/lsp-sample-scene" "$out/scene.glb"
  meshes=("$PWD/$out/scene.glb")
  title="the atrium"
  view=(--camera=-7.9,1.5,-0.9:3,3.1,0.35:66)
  light=(--exposure 0.3)
else
  title=$(basename "${meshes[0]}")
fi

say "baking"
"$bin/lsp-bake" "${meshes[@]}" -o "$out/scene.lsp" --json >"$out/bake.json"

say "validating"
started=$(date +%s.%N)
"$bin/lsp-validate" "$out/scene.lsp"
validated=$(date +%s.%N)
seconds=$(awk "BEGIN { printf \"%.3f\", $validated - $started }")
echo "valid, $seconds s"

render() { # render NAME MODE BACKEND [OPTION...]
  local name=$1 mode=$2 device=$3
  shift 3
  [ "$mode" = exact ] || set -- --light-quality fast "$@"
  "$bin/lsp-render" "$out/scene.lsp" -o "$out/$name.png" -o "$out/$name.pfm" --mode "$mode" --backend "$device" \
    --size 576x324 --samples 8 --denoise "${view[@]}" "${light[@]}" "$@" --json >"$out/$name.json"
}
compare() { # compare NAME PICTURE REPORT: with exact.pfm
  "$bin/lsp-compare" "$out/exact.pfm" "$out/$1.pfm" -o "$out/$2.png" --factor 4 --json >"$out/$3.json"
}
point() { # point NAME [OPTION...]: of the dial's curve, a small picture of many samples that needs no denoising
  local name=$1
  shift
  "$bin/lsp-render" "$out/scene.lsp" -o "$out/curve_$name.pfm" --backend "$backend" --size 96x54 --samples 16 \
    "${view[@]}" "$@" --quiet --json >"$out/curve_$name.json"
  if [ "$name" != exact ]; then
    "$bin/lsp-compare" "$out/curve_exact.pfm" "$out/curve_$name.pfm" --json >"$out/curve_compare_$name.json"
  fi
}

# Approximate rays to lights, from where others land, are tables' alone: most of the rays, and their errors show least.
say "rendering indirect light, exact and approximate"
backend=vulkan
if ! render exact exact vulkan; then
  echo "demo.sh: no Vulkan device can be used (see above): rendering on the CPU instead"
  backend=cpu
  render exact exact cpu
fi
# The other pictures are exposed as the exact one.
light=(--exposure="$(sed -n 's/^ *"exposure": \(.*\),$/\1/p' "$out/exact.json")")
render approx approximate "$backend" --quiet  # its notes are the exact one's
compare approx difference compare
if grep -q '"cells": {' "$out/bake.json"; then
  say "the dial's curve"
  point exact --mode exact
  for quality in fast balanced accurate; do
    point "$quality" --mode approximate --light-quality fast --quality "$quality"
  done
  for loss in 30 10 3 1; do
    point "$loss" --mode approximate --light-quality fast --max-loss "$loss"
  done
fi

say "result"
"$bin/lsp-demo-report" "$out" -o "$out/report.html" --title "$title" --validate-seconds "$seconds"
