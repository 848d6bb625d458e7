#!/usr/bin/env bash
# Installs the Kaitai Struct compiler and runtime into FOLDER, once, and compares the two readers.
#
#   run.sh FOLDER LSP.KSY DUMP-PROGRAM FILE.lsp...
#
# Exit 77 (skipped) where node or npm is missing, or the packages cannot be fetched.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
folder=$1
shift
for tool in node npm; do
  if ! command -v "$tool" >/dev/null; then
    echo "SKIPPED: $tool is not installed (packages nodejs, npm)"
    exit 77
  fi
done
mkdir -p "$folder"
cp "$here/package.json" "$here/compare.js" "$folder/"
if [ ! -d "$folder/node_modules/kaitai-struct-compiler" ] || [ ! -d "$folder/node_modules/fzstd" ]; then
  if ! (cd "$folder" && npm install --no-audit --no-fund --loglevel=error); then
    echo "SKIPPED: npm could not fetch kaitai-struct-compiler; is there a network?"
    exit 77
  fi
fi
exec node "$folder/compare.js" "$@"
