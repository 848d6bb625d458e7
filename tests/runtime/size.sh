#!/usr/bin/env bash
# size.sh CXX WORK_DIR LIBLSP LIBLSP_VULKAN [FLAGS...]
#
# What the runtime adds to an engine: liblsp, stripped, has at most 400,000 bytes, and neither library needs another
# than the C and C++ run time, liblsp zstd where it reads packed files (then FLAGS link it). Archives are linked, whole,
# into shared libraries first.
set -euo pipefail
cxx=$1 work=$2 lsp=$3 vulkan=$4
shift 4
limit=400000
mkdir -p "$work"

shared() { # shared LIBRARY OUT [FLAGS...]: a stripped copy
  local library=$1 out=$2
  shift 2
  case $library in
    *.a) "$cxx" -shared -o "$out" -Wl,--whole-archive "$library" -Wl,--no-whole-archive "$@" ;;
    *) cp "$library" "$out" ;;
  esac
  strip --strip-all "$out"
}
needs() { # needs LIBRARY NAME...: and nothing else
  local library=$1 name
  shift
  for name in $(readelf -d "$library" | sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p'); do
    case " $* " in
      *" ${name%%.so*} "*) ;;
      *) echo "$(basename "$library") needs $name, an engine may not have it"; exit 1 ;;
    esac
  done
}

shared "$lsp" "$work/liblsp.so" "$@"
shared "$vulkan" "$work/liblsp_vulkan.so"
runtime="libc libm libgcc_s libstdc++ ld-linux-x86-64 ld-linux-aarch64"
needs "$work/liblsp.so" $runtime ${1:+libzstd}
needs "$work/liblsp_vulkan.so" $runtime liblsp
bytes=$(stat -c %s "$work/liblsp.so")
echo "liblsp has $bytes bytes, stripped, liblsp_vulkan with its shaders $(stat -c %s "$work/liblsp_vulkan.so")"
[ "$bytes" -le "$limit" ] || { echo "more than $limit; nm --size-sort says of what"; exit 1; }
