#!/usr/bin/env bash
# recipe.sh SOURCE_DIR WORK_DIR CC: README's recipe for errors as noise compiles as it stands there.
set -euo pipefail
source=$1 work=$2 compiler=$3
mkdir -p "$work"
awk '/^#/ { here = /^### Errors as noise$/ } /^```$/ { code = 0 } here && code { print } /^```c$/ { code = 1 }' \
  "$source/README.md" >"$work/recipe.inc"
grep -q 'lsp_trace' "$work/recipe.inc"
"$compiler" -std=c11 -Wall -Wextra -Werror -fsyntax-only -I "$work" -I "$source/runtime/include" \
  -I "$source/format-spec/include" "$source/tests/runtime/recipe.c"
