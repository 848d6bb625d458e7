#!/usr/bin/env bash
# run.sh SOURCE_DIR BUILD_DIR WORK_DIR PACKAGE...
#
# Makes the Debian packages of a build, which are to be these, installs them below a folder, runs the programs, builds
# and runs a project against the library there, and removes them again. Exit 77: the tools for that are not here.
set -euo pipefail
source=$1 build=$2 work=$3
shift 3
wanted=$(printf '%s\n' "$@" | sort)
fail() { echo "packages: $*" >&2; exit 1; }
for tool in dpkg dpkg-deb dpkg-shlibdeps file readelf; do
  command -v $tool >/dev/null || { echo "skipped: $tool is missing"; exit 77; }
done

rm -rf "$work"
mkdir -p "$work"
cd "$work"
cpack -G DEB --config "$build/CPackConfig.cmake" -B "$work/debs" >cpack.log 2>&1 || { cat cpack.log; fail "cpack failed"; }
debs=(debs/*.deb)
printf '%s\n' "${debs[@]}"
names=$(for deb in "${debs[@]}"; do dpkg-deb -f "$deb" Package; done | sort)
[ "$names" = "$wanted" ] || fail "made are: $names"
has() { grep -qx "$1" <<<"$names"; }

# What they hold: no file twice, nothing outside /usr, a copyright each.
for deb in "${debs[@]}"; do
  dpkg-deb -f "$deb" Package Version Depends | tr '\n' ';'; echo
  dpkg-deb --fsys-tarfile "$deb" | tar -t | grep -v '/$' >"files.$(dpkg-deb -f "$deb" Package)"
done
cat files.* | sort | uniq -d | grep . && fail "these files are in two packages"
grep -v '^\./usr/' files.* && fail "these files are outside /usr"
for name in $names; do grep -q "doc/$name/copyright" "files.$name" || fail "$name has no copyright"; done
field() { dpkg-deb -f debs/"$1"_*.deb "$2"; }
if has lsp-tools; then
  for library in libtbb12 libzstd1 libc6; do
    [[ $(field lsp-tools Depends) == *$library* ]] || fail "lsp-tools does not know that it needs $library"
  done
fi
if has liblsp0.1; then
  [[ $(field liblsp0.1 Depends) == *libc6* ]] || fail "liblsp0.1 does not know what it needs"
  for name in $names; do
    [ "$name" = liblsp0.1 ] || [[ $(field "$name" Depends) == *"liblsp0.1 (="* ]] || fail "$name does not depend on liblsp0.1"
  done
fi

# Installed below a folder: as dpkg does it where that may be done, else unpacked.
root=$work/root
# The scripts, which call ldconfig, run outside of it, and this machine's cache stays as it is.
mkdir -p instead
printf '#!/bin/sh\n' >instead/ldconfig
chmod +x instead/ldconfig
as_dpkg() {
  PATH="$work/instead:$PATH" dpkg --root="$root" --force-depends --force-script-chrootless --no-triggers "$@" >dpkg.log 2>&1 ||
    { cat dpkg.log; fail "dpkg $1 failed"; }
}
mkdir -p "$root"/var/lib/dpkg/{info,updates}
touch "$root"/var/lib/dpkg/{status,available}
if [ "$(id -u)" = 0 ]; then
  as_dpkg --install "${debs[@]}"
else
  for deb in "${debs[@]}"; do dpkg-deb -x "$deb" "$root"; done
fi

# Programs and libraries run where they lie, and know one another by their place alone.
unset LD_LIBRARY_PATH
for file in "$root"/usr/bin/* $(find "$root/usr/lib" -name '*.so.*' -type f); do
  [ -e "$file" ] || continue
  if readelf -d "$file" | grep -E 'R(UN)?PATH' | grep -vE '\[\$ORIGIN(:\$ORIGIN/[^:]*)*\]'; then fail "$file looks elsewhere"; fi
  if ldd "$file" | grep -E 'liblsp|not found' | grep -v "$root"; then fail "$file does not find its library"; fi
done
if has lsp-tools; then
  manuals=$(grep -c 'LSP_HELP2MAN:FILEPATH=/' "$build/CMakeCache.txt" || true)
  for name in bake merge validate info trace render compare sample-scene; do
    program=$root/usr/bin/lsp-$name
    "$program" --version >/dev/null || fail "$program does not start"
    "$program" --help >help.txt
    grep -nE '.{81}|TEXT|:\{|More options' help.txt && fail "$program --help is not fit to read"
    [ "$manuals" = 0 ] || [ -s "$root/usr/share/man/man1/lsp-$name.1" ] || fail "$program has no manual page"
    [ -s "$root/usr/share/bash-completion/completions/lsp-$name" ] || fail "$program has no completion"
  done
  . "$root/usr/share/bash-completion/completions/lsp-render"
  completes() { # completes ANSWER WORD...: the last is the one at the cursor
    local answer=$1
    shift
    COMP_WORDS=("$@") COMP_CWORD=$(($# - 1))
    _lsp_complete
    [ "${COMPREPLY[*]}" = "$answer" ] || fail "bash completes ${*:2} to '${COMPREPLY[*]}'"
  }
  completes "--effect" "$root/usr/bin/lsp-render" x.lsp --eff
  completes "diffuse direct" "$root/usr/bin/lsp-render" x.lsp --effect d
  completes "--output" "$root/usr/bin/lsp-bake" --out
  completes "" "$root/usr/bin/lsp-bake" --output x  # files are bash's own
  "$root/usr/bin/lsp-info" --version
  "$root/usr/bin/lsp-info" --quiet "$source/format-spec/corpus/2.0/valid/full.lsp"
fi

# A project finds library and lsp-bake there.
cmake -S "$source/tests/runtime/embedded" -B consumer -G Ninja -DLSP_BY=package -DCMAKE_PREFIX_PATH="$root/usr" >cmake.log 2>&1 &&
  cmake --build consumer >>cmake.log 2>&1 || { cat cmake.log; fail "a project cannot be built with the packages"; }
grep -q "lsp_DIR:PATH=$root" consumer/CMakeCache.txt || fail "the project found another lsp"
corpus=$source/format-spec/corpus/2.0/valid
consumer/embedded_c "$corpus/full.lsp"
consumer/embedded_cpp "$corpus/full.lsp" "$corpus/packed.lsp" yes
! has lsp-tools || [ -s consumer/corner.lsp ] || fail "the project's asset was not baked"

# And nothing is left of them.
if [ "$(id -u)" = 0 ]; then
  as_dpkg --remove $names
  find "$root" ! -type d ! -path '*/var/lib/dpkg/*' | grep . && fail "these files are left"
  [ ! -e "$root/usr" ] || fail "folders are left"
fi
echo "packages ok"
