#!/usr/bin/env bash
# Installs the Debian packages of packages.txt that are missing; does nothing, and needs no network, when all are
# there.
#
#   ./samples/setup.sh [--list] [PACKAGE...]
#
# --list only prints what is missing. PACKAGEs are wanted as well. Runs apt-get as root, or with sudo.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)

list_only=0
case "${1:-}" in
  --list) list_only=1; shift ;;
  --help) sed -n '2,7s/^# \{0,1\}//p' "$0"; exit 0 ;;
  -*) echo "setup.sh: unknown option $1, see --help" >&2; exit 1 ;;
esac

if ! command -v dpkg-query >/dev/null; then
  echo "setup.sh: this is no Debian system; install the equivalents of $here/packages.txt yourself" >&2
  exit 5
fi

missing=()
while IFS= read -r package; do
  case "$package" in '' | '#'*) continue ;; esac
  state=$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)
  [ "$state" = installed ] || missing+=("$package")
done < <(cat "$here/packages.txt"; printf '%s\n' "$@")

if [ ${#missing[@]} -eq 0 ]; then exit 0; fi
if [ "$list_only" = 1 ]; then printf '%s\n' "${missing[@]}"; exit 0; fi

echo "setup.sh: installing from Debian: ${missing[*]}"
as_root=()
if [ "$(id -u)" != 0 ]; then
  if ! command -v sudo >/dev/null; then
    echo "setup.sh: cannot install: run as root or install sudo, or install by hand: ${missing[*]}" >&2
    exit 2
  fi
  as_root=(sudo)
fi
apt() { "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq -o Dpkg::Use-Pty=0 "$@"; }
if ! apt update || ! apt install --no-install-recommends -y "${missing[@]}"; then
  echo "setup.sh: apt-get failed; check the network and the package sources, then run this again" >&2
  exit 2
fi
