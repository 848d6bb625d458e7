#!/usr/bin/env bash
# shared.sh SOURCE_DIR WORK_DIR C_COMPILER CXX_COMPILER [LAUNCHER]
#
# The packages of the library alone, as a shared one: built without optimisation, packed, tested by run.sh.
set -euo pipefail
source=$1 work=$2
mkdir -p "$work"
cmake -S "$source" -B "$work/build" -G Ninja -DCMAKE_BUILD_TYPE=Debug -DBUILD_SHARED_LIBS=ON -DLSP_PROGRAMS=OFF \
  -DLSP_VULKAN=OFF -DCMAKE_INSTALL_PREFIX=/usr -DCMAKE_C_COMPILER="$3" -DCMAKE_CXX_COMPILER="$4" \
  -DCMAKE_C_COMPILER_LAUNCHER="${5:-}" -DCMAKE_CXX_COMPILER_LAUNCHER="${5:-}" >"$work/log" || { cat "$work/log"; exit 1; }
cmake --build "$work/build" >>"$work/log" 2>&1 || { cat "$work/log"; exit 1; }
"$(dirname "$0")/run.sh" "$source" "$work/build" "$work/packages" liblsp0.1 liblsp-dev

# What --install says of programs in such a build: they look for libraries beside themselves.
cmake -S "$source" -B "$work/programs" -G Ninja -DBUILD_SHARED_LIBS=ON -DLSP_TESTS=OFF -DCMAKE_C_COMPILER="$3" \
  -DCMAKE_CXX_COMPILER="$4" >>"$work/log" || { cat "$work/log"; exit 1; }
grep -qF 'RPATH "\$ORIGIN:\$ORIGIN/../lib")' "$work/programs/cmake_install.cmake" || { echo "programs have no RPATH"; exit 1; }
