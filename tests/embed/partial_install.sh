#!/usr/bin/env bash
# Of a tree in which one program is built, all that is there is installed, what is missing is said, and
# no package is made.
# partial_install.sh CMAKE CPACK SOURCE OUT GENERATOR
set -euo pipefail
cmake=$1 cpack=$2 source=$3 out=$4 generator=$5
fail() { echo "$*"; exit 1; }
rm -rf "$out"
"$cmake" -S "$source" -B "$out/build" -G "$generator" -DRTPM_BUILD_TESTS=OFF -DRTPM_BUILD_BENCH=OFF \
  --log-level=WARNING
mkdir -p "$out/build/bin"
echo 'as if built' >"$out/build/bin/rtpm-registryd"
said=$("$cmake" --install "$out/build" --prefix "$out/prefix" 2>&1) || fail "it is not installed: $said"
[[ $(cat "$out/prefix/bin/rtpm-registryd") == 'as if built' ]] || fail "what is built is not installed"
flat=$(tr -s ' \n' ' ' <<<"$said")
[[ $flat == *"not installed, as not built: "*"rtpm-servo"* ]] || fail "nothing is said to be missing: $said"
[[ $flat != *"rtpm-registryd,"* ]] || fail "what is built is said to be missing: $said"
said=$("$cpack" --config "$out/build/CPackConfig.cmake" -G TGZ -B "$out/packages" \
  -D CPACK_COMPONENTS_ALL=programs -D CPACK_ARCHIVE_COMPONENT_INSTALL=ON 2>&1) && fail "a package without programs is made: $said"
[[ $(tr -s ' \n' ' ' <<<"$said") == *"without what is not built: "*"rtpm-servo"* ]] ||
  fail "the package does not say what is missing: $said"
! compgen -G "$out/packages/*.tar.gz" >/dev/null || fail "a package is there"
echo "a part is installed, and is no package"
