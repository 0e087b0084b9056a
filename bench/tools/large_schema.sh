#!/usr/bin/env bash
# How long a schema of 200 services with ten methods each takes: rtpmc, flatc, and a compiler that reads
# the generated header.   large_schema.sh BUILD-FOLDER [COMPILER]
set -euo pipefail
build=$(readlink -f "${1:?the build folder is missing}")
compiler=${2:-c++}
source=$(readlink -f "$(dirname "$0")/../..")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
{
  printf 'include "rtpm.fbs";\nnamespace big;\n'
  for ((service = 0; service < 200; ++service)); do
    printf 'struct S%d { a:double; b:double; c:int; }\n' "$service"
    printf 'table M%d { value:S%d (required); }\n' "$service" "$service"
    printf 'table T%d { name:string; count:int = 3; values:[S%d]; }\n' "$service" "$service"
    printf 'rpc_service Service%d {\n' "$service"
    for ((method = 1; method <= 10; ++method)); do
      type=$([[ $((method % 2)) == 0 ]] && echo M || echo T)
      printf '  method_%d(%s%d):%s%d (rtpm_id: %d);\n' "$method" "$type" "$service" "$type" "$service" "$method"
    done
    printf '}\n'
  done
} >big.fbs
TIMEFORMAT='%R s, of CPU %U s'
printf 'rtpmc:  '
time "$build/bin/rtpmc" -I "$source/schema/idl" --cpp -o . big.fbs
printf 'flatc:  '
time flatc --cpp --cpp-std c++17 --scoped-enums --gen-object-api -I "$source/schema/idl" -o . big.fbs
flatc --cpp --cpp-std c++17 --scoped-enums --gen-object-api -I "$source/schema/idl" -o . "$source/schema/idl/rtpm.fbs"
"$build/bin/rtpmc" split-objects big_generated.h big_generated.cpp
echo '#include "big.rtpm.hpp"' >big.cpp
includes=(-I .)
for include in protocol/base protocol/wire runtime/rt runtime/transport runtime/rpc; do
  includes+=(-I "$source/$include/include")
done
printf 'header: '
time "$compiler" -std=c++20 "${includes[@]}" -c big.cpp -o big.o
printf 'source: '
time "$compiler" -std=c++20 "${includes[@]}" -c big.rtpm.cpp -o source.o
wc -l big.fbs big.rtpm.hpp big.rtpm.cpp big_generated.h
