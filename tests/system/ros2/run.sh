#!/bin/sh
# run.sh PROGRAMS PYTHON ARGUMENTS…: runs Python in a network namespace with loopback and multicast only.
set -eu
export RTPM_PROGRAMS="$1"
shift
export ROS_DOMAIN_ID=17 PYTHONPATH="$(dirname "$0")" PYTHONDONTWRITEBYTECODE=1
exec unshare --net --map-root-user -- sh -c 'ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo && exec "$@"' sh "$@"
