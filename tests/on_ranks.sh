#!/bin/sh
# Run a command under mpirun and show what one rank prints, so that a test run reads as one:
#   tests/on_ranks.sh mpirun -n 2 COMMAND...      (options of mpirun that take no value may follow the number)
# What the other ranks print is shown only when the command fails.
set -u
if [ "$1" = --rank ]; then
    folder=$2
    shift 2
    rank=${OMPI_COMM_WORLD_RANK:-${PMIX_RANK:-${PMI_RANK:-0}}}
    if [ "$rank" = 0 ]; then exec "$@"; fi
    exec "$@" > "$folder/rank$rank" 2>&1
fi

launcher="$1 $2 $3"
shift 3
while [ "${1#--}" != "$1" ]; do launcher="$launcher $1"; shift; done
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
trap 'exit 130' INT TERM
$launcher "$0" --rank "$folder" "$@"
code=$?
if [ $code != 0 ]; then
    for log in "$folder"/rank*; do
        [ -f "$log" ] || continue
        echo "---- ${log##*/} ended with:"
        tail -n 60 "$log"
    done
fi
exit $code
