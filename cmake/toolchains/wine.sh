#!/bin/sh
# wine.sh PREFIX PROGRAM [ARGUMENT…]: runs a Windows program; PREFIX is the folder of wine's state.
export WINEPREFIX="$1"
# No messages of wine's own, no desktop entries, no offers to install .NET and a browser.
export WINEDEBUG="${WINEDEBUG--all}" WINEDLLOVERRIDES="winemenubuilder.exe,mscoree,mshtml="
shift
# Debian's package wine64 has no program in the PATH.
wine=$(command -v wine64) || wine=/usr/lib/wine/wine64
exec "$wine" "$@"
