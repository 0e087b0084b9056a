#!/usr/bin/env bash
# The same program without CMake: rtpmc and flatc by hand, and what pkg-config says.
# pkg_config.sh PREFIX PKGCONFIG-FOLDER FLATC COMPILER-LAUNCHER COMPILER OUT
set -euo pipefail
flatc=$3 launcher=$4 compiler=$5 out=$6
export PKG_CONFIG_PATH=$2
command -v pkg-config >/dev/null || { echo "SKIPPED: pkg-config is not installed"; exit 0; }
cd "$(dirname "$0")"
mkdir -p "$out"
for schema in "common schemas/units.fbs" gauge.fbs; do
  "$(pkg-config --variable=rtpmc rtpm)" -I "common schemas" --cpp -o "$out" "$schema"
  "$flatc" --cpp --cpp-std c++17 --scoped-enums --gen-object-api -I "$(pkg-config --variable=idldir rtpm)" \
    -I "common schemas" -o "$out" "$schema"
done
for source in main.cpp "$out/gauge.rtpm.cpp"; do
  # shellcheck disable=SC2046  # pkg-config gives words.
  $launcher "$compiler" $(pkg-config --cflags rtpm) -I "$out" -c "$source" \
    -o "$out/$(basename "$source").o"
done
# shellcheck disable=SC2046
"$compiler" "$out"/*.o $(pkg-config --libs rtpm) -o "$out/program"
"$out/program"
