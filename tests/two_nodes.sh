#!/usr/bin/env bash
# Run a command by mpirun on two nodes that are namespaces of this machine: each with a network and a host name of its
# own, joined by a pair of virtual cables, so that Open MPI takes them for two machines. Needs root and iproute2.
#
#   tests/two_nodes.sh RANKS_PER_NODE COMMAND...
set -euo pipefail
ranks=$1
shift
one=softjaw-$$-a two=softjaw-$$-b
agent=$(mktemp)
stop() {
    ip netns del "$one" 2> /dev/null || true
    ip netns del "$two" 2> /dev/null || true
    rm -f "$agent"
}
trap stop EXIT

ip netns add "$one"
ip netns add "$two"
ip link add "sj$$a" netns "$one" type veth peer name "sj$$b" netns "$two"
ip -n "$one" addr add 10.77.0.1/24 dev "sj$$a"
ip -n "$two" addr add 10.77.0.2/24 dev "sj$$b"
for space in "$one" "$two"; do ip -n "$space" link set lo up; done
ip -n "$one" link set "sj$$a" up
ip -n "$two" link set "sj$$b" up

# what mpirun takes for ssh: it gets the host's address and the command that starts Open MPI's daemon there
cat > "$agent" << AGENT
#!/bin/sh
shift
exec ip netns exec $two unshare --uts sh -c "hostname nodeb; \$*"
AGENT
chmod +x "$agent"
ip netns exec "$one" unshare --uts sh -c 'hostname nodea; "$@"' sh \
    mpirun --host "10.77.0.1:$ranks,10.77.0.2:$ranks" -n "$((2 * ranks))" --oversubscribe --mca plm rsh \
    --mca plm_rsh_agent "$agent" --mca oob_tcp_if_include 10.77.0.0/24 --mca btl_tcp_if_include 10.77.0.0/24 \
    -x OMP_NUM_THREADS "$@"
