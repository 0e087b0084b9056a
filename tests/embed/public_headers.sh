#!/usr/bin/env bash
# public_headers.sh PREFIX INCLUDE_FOLDER LIST COMPILER…: compiles each installed header of RTPM that no other
# one includes by itself, and so the others with it, without the source tree; compares the names of all with
# the reviewed list.
set -euo pipefail
include=$1/$2 list=$3
shift 3
cd "$include"
headers() { find rtpm -name '*.hpp' -not -path 'rtpm/idl/*' | LC_ALL=C sort; }
included() { headers | xargs sed -nE 's/^#include "(rtpm\/[^"]+)"/\1/p' | LC_ALL=C sort -u; }
diff <(headers) <(grep -oE 'rtpm/[a-z_/]+\.hpp' "$list" | LC_ALL=C sort) ||
  { echo "installed (<) and listed (>) headers differ"; exit 1; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export include work
# shellcheck disable=SC2016
LC_ALL=C comm -23 <(headers) <(included) |
  xargs -P "$(nproc)" -I{} bash -c 'source=$work/$(tr / _ <<<"{}").cpp
    echo "#include \"{}\"" >"$source"
    "$@" -std=c++20 -fsyntax-only -I"$include" -I"$include/rtpm/idl" "$source"' compile "$@"
echo "all $(headers | wc -l) headers compile alone, in $(find "$work" -name '*.cpp' | wc -l) files"
