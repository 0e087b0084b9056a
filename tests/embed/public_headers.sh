#!/usr/bin/env bash
# public_headers.sh PREFIX INCLUDE_FOLDER LIST COMPILER…: compiles each installed header of RTPM by itself,
# without the source tree, and compares their names with the reviewed list.
set -euo pipefail
prefix=$1 include=$1/$2 list=$3
shift 3
[[ -d $prefix ]]
diff <(cd "$include" && find rtpm -name '*.hpp' -not -path 'rtpm/idl/*' | LC_ALL=C sort) \
  <(grep -oE 'rtpm/[a-z_/]+\.hpp' "$list" | LC_ALL=C sort) ||
  { echo "installed (<) and listed (>) headers differ"; exit 1; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export include work
# shellcheck disable=SC2016
(cd "$include" && find rtpm -name '*.hpp' -not -path 'rtpm/idl/*') |
  xargs -P "$(nproc)" -I{} bash -c 'source=$work/$(tr / _ <<<"{}").cpp
    echo "#include \"{}\"" >"$source"
    "$@" -std=c++20 -fsyntax-only -I"$include" -I"$include/rtpm/idl" "$source"' compile "$@"
echo "each of $(find "$work" -name '*.cpp' | wc -l) headers compiles alone"
