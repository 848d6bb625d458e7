#!/usr/bin/env bash
# Measures on a machine with a GPU that has none of our packages: everything it needs goes there in one file.
#
#   tests/bench/gpu.sh pack FILE.tgz SCENE...    here: builds, and packs programs, their libraries and the scenes
#   tests/bench/gpu.sh run  FILE.tgz OUT [ARGUMENTS OF lsp-bench]
#                                                there: unpacks beside FILE.tgz and runs lsp-bench, by default its pareto
#                                                suite, under ten minutes for six scenes; the report is OUT/report.html
#
# The machine needs glibc, a Vulkan driver and its loader, libvulkan.so.1. tests/bench/RESULTS.md has the figures.
set -euo pipefail

fail() { echo "gpu.sh: $1" >&2; exit "${2:-1}"; }

pack() {
  [ $# -ge 2 ] || fail "pack needs a file to write and scenes, see the head of this script"
  local root out=$1 folder scene file
  root=$(cd "$(dirname "$0")/../.." && pwd)
  shift
  cmake --build --preset release --target lsp-bench lsp-bake
  folder=$(mktemp -d)
  trap 'rm -rf "$folder"' RETURN
  mkdir "$folder/bin" "$folder/lib" "$folder/scenes"
  cp "$0" "$folder/"
  cp "$root"/build/release/bin/lsp-bench "$root"/build/release/bin/lsp-bake "$folder/bin/"
  strip "$folder"/bin/*
  # glibc and the loader are the machine's own, they fit its drivers.
  ldd "$folder"/bin/* | awk '$2 == "=>" && $3 ~ /^\// {print $3}' | sort -u |
    grep -vE '/(libc|libm|libdl|librt|libpthread|libvulkan|ld-linux[^/]*)\.so' |
    while IFS= read -r file; do cp "$file" "$folder/lib/"; done
  for scene in "$@"; do
    [ -f "$scene" ] || fail "$scene: cannot be read" 2
    # The scene, and what of the same name or of its materials lies beside it.
    cp "$scene" "$folder/scenes/"
    for file in "${scene%.*}".bin "$(dirname "$scene")"/*.mtl; do
      [ ! -f "$file" ] || cp "$file" "$folder/scenes/"
    done
  done
  tar czf "$out" -C "$folder" .
  echo "$out: $(du -h "$out" | cut -f1)"
}

run() {
  [ $# -ge 2 ] || fail "run needs the packed file and a folder for the report, see the head of this script"
  local packed=$1 out=$2 folder
  shift 2
  folder=$(dirname "$packed")/gpu-bench
  mkdir -p "$folder"
  tar xzf "$packed" -C "$folder"
  [ $# -gt 0 ] || set -- --suite pareto
  local scenes=()
  while IFS= read -r file; do scenes+=("$file"); done < <(
    find "$folder/scenes" -type f ! -name '*.bin' ! -name '*.mtl' | sort)
  LD_LIBRARY_PATH="$folder/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}" PATH="$folder/bin:$PATH" \
    "$folder/bin/lsp-bench" "${scenes[@]}" -o "$out" "$@"
}

case "${1:-}" in
  pack) shift; pack "$@" ;;
  run) shift; run "$@" ;;
  *) sed -n '2,10s/^# \{0,1\}//p' "$0"; exit 1 ;;
esac
