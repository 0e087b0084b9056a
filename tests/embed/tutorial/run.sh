#!/usr/bin/env bash
# Runs a tutorial: its code blocks are written to files (```LANGUAGE FILE), found in them line by line
# (```LANGUAGE in FILE), run (```sh), run beside the others (```sh background), or end the newest of these
# (```sh stop), in their order; each line of a ```text block must have been printed by the commands before it.
# run.sh TUTORIAL.md FOLDER PROGRAM-FOLDER CMAKE-PREFIX GENERATOR COMPILER LAUNCHER
set -euo pipefail
tutorial=$1 folder=$2 prefix=$4
export PATH=$3:$PATH CMAKE_PREFIX_PATH=$4 CMAKE_GENERATOR=$5 CXX=$6 CMAKE_CXX_COMPILER_LAUNCHER=$7
rm -rf "$folder"
mkdir -p "$folder"
cd "$folder"
background=()
trap 'for id in "${background[@]}"; do kill "$id" 2>/dev/null || true; done' EXIT
# Another server may have the tutorial's port on this machine.
port=$((20000 + RANDOM % 10000))
output=.output

fail() { printf 'tutorial: %s\n' "$*" >&2; exit 1; }

# How many of the lines in the file $1 are in the file $2: all, or the first that lacks is told.
has_lines() {
  local line
  while IFS= read -r line; do
    grep -qxF -- "$line" "$2" || { missing=$line; return 1; }
  done <"$1"
}

run_block() {
  local kind=$1 turn command
  case $kind in
    sh)
      echo "+ $(cat .block)"
      output=.output
      bash -euo pipefail .block >.output 2>&1 || { cat .output; fail "a step failed"; }
      cat .output ;;
    "sh background")
      # Its standard input stays open, as a terminal's would. exec: so that the number is its own.
      [[ -p .input ]] || mkfifo .input
      exec 9<>.input
      command=$(cat .block)
      output=.background
      : >.background
      bash -c "exec $command" <.input >.background 2>&1 9>&- &
      background+=($!) ;;
    "sh stop")
      output=.background
      kill "${background[-1]}"
      wait "${background[-1]}" || true
      unset 'background[-1]' ;;
    text)
      for ((turn = 0; turn < 100; ++turn)); do
        has_lines .block "$output" && return 0
        sleep 0.1
      done
      cat "$output"
      fail "this was not printed: $missing" ;;
    *" in "*)
      has_lines .block "${kind#* in }" || fail "this is not in ${kind#* in }: $missing" ;;
    *" "*)
      mv .block "${kind#* }" ;;
    *)
      fail "a block of kind '$kind' is unknown" ;;
  esac
}

count=0 is_open=false kind=
while IFS= read -r line || [[ -n $line ]]; do
  if [[ $line == '```'* ]]; then
    if $is_open; then
      run_block "$kind"
      count=$((count + 1))
      is_open=false
    else
      kind=${line#'```'} is_open=true
      : >.block
    fi
  elif $is_open; then
    line=${line//4711/$port}
    printf '%s\n' "${line//\/usr\/share\//$prefix/share/}" >>.block
  fi
done <"$tutorial"
echo "all $count blocks of the tutorial hold"
