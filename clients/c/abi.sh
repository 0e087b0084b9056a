#!/bin/sh
# Compares the library's functions and types with those that are promised, by abidiff.
#   abi.sh LIBRARY            fails if they differ, and says how
#   abi.sh LIBRARY --update   makes those of the library the promised ones
set -eu
here=$(cd "$(dirname "$0")" && pwd)
promised=$here/rtpm-c.abi
if ! command -v abidiff > /dev/null; then
  echo "[  SKIPPED ] needs the Debian package abigail-tools"
  exit 0
fi
present=$(mktemp)
trap 'rm -f "$present"' EXIT
abidw --no-show-locs --no-comp-dir-path --no-corpus-path --no-elf-needed --drop-private-types \
  --exported-interfaces-only --headers-dir "$here/include" "$1" |
  sed "s:path='[^']*/src/:path='src/:" > "$present"
if [ "${2-}" = --update ]; then
  cp "$present" "$promised"
elif abidiff "$promised" "$present"; then
  echo "the functions and types are those that are promised"
else
  echo "librtpm-c is not the promised one. Where functions, or fields behind the last one of a struct,"
  echo "were added, and nothing else, run clients/c/abi.sh LIBRARY --update; else give the old one back."
  exit 1
fi
