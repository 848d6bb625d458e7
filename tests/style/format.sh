#!/usr/bin/env bash
# Whether the sources are as clang-format 14 writes them, by the .clang-format of the project's folder, the first argument.
# Not asked are headers that shaders read as well: GLSL's texts and tables are no C++ to it.
set -euo pipefail
cd "$1"

command -v clang-format-14 >/dev/null || { echo "SKIPPED: no clang-format-14"; exit 77; }
shared='/(layout|interface|parts|arithmetic|traverse|bvh|ntree|wide|cells|instance_walk)\.h$'
mapfile -t files < <(find baker format-spec runtime samples tests -name '*.cpp' -o -name '*.h' -o -name '*.hpp' -o -name '*.c' |
  grep -Ev "include/lsp$shared" | sort)
if [ "${#files[@]}" -lt 100 ]; then echo "only ${#files[@]} sources in $1"; exit 1; fi
if ! printf '%s\0' "${files[@]}" | xargs -0 -n 40 -P "$(nproc)" clang-format-14 --dry-run -Werror; then
  echo "format them: clang-format-14 -i FILE..., or git clang-format-14 before a commit"
  exit 1
fi
echo "${#files[@]} sources"
