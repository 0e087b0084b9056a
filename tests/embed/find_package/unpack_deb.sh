#!/usr/bin/env bash
# Makes the Debian packages of a build, checks them, and unpacks the one to build with.
# unpack_deb.sh CPACK BUILD-FOLDER OUT
set -euo pipefail
cpack=$1 build=$2 out=$3
rm -rf "$out"
mkdir -p "$out"
"$cpack" --config "$build/CPackConfig.cmake" -G DEB -B "$out" -D CPACK_COMPONENTS_ALL=development >"$out/cpack.log" 2>&1 ||
  { cat "$out/cpack.log"; exit 1; }
package=("$out"/librtpm-dev_*.deb)
dpkg-deb --field "${package[0]}" Package Version Depends
dpkg-deb --extract "${package[0]}" "$out/unpacked"
test -x "$out/unpacked/usr/bin/rtpmc"
