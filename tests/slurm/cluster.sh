#!/usr/bin/env bash
# A Slurm of one node on this machine, for as long as a command takes: daemons, key, state and logs lie in one folder,
# and nothing of a Slurm that is installed already is read or changed. Needs root, because slurmd does.
#
#   tests/slurm/cluster.sh FOLDER COMMAND...     FOLDER takes the logs; COMMAND sees sbatch, squeue and scontrol
set -euo pipefail
folder=$(mkdir -p "$1" && cd "$1" && pwd)
shift
PATH=$PATH:/usr/sbin
say() { printf 'slurm: %s\n' "$*"; }
fail() { printf 'slurm: %s\n' "$@" >&2; exit 1; }
cannot() { printf 'slurm: %s\n' "$@" >&2; exit 77; } # nothing was tried

[ "$(id -u)" = 0 ] || cannot "slurmd has to be started by root"
for program in munged slurmctld slurmd sbatch; do command -v $program > /dev/null || missing=1; done
if [ -n "${missing:-}" ]; then
    command -v apt-get > /dev/null || cannot "munge, slurmctld, slurmd and slurm-client are not installed, nor is apt-get"
    say "installing Debian's munge, slurmctld, slurmd and slurm-client"
    apt-get update -qq || true
    DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends munge slurmctld slurmd slurm-client \
        > "$folder/apt.log" 2>&1 || cannot "apt-get could not install Slurm; see $folder/apt.log"
fi

# munged refuses folders that others may write to, such as those below /tmp
private=$(mktemp -d /run/softjaw-slurm.XXXXXX)
chmod 755 "$private"
pids=()
stop() {
    for ((i = ${#pids[@]} - 1; i >= 0; i--)); do kill "${pids[i]}" 2> /dev/null || true; done
    for pid in "${pids[@]}"; do wait "$pid" 2> /dev/null || true; done
    rm -rf "$private"
}
trap stop EXIT

head -c 1024 /dev/urandom > "$private/key"
chmod 400 "$private/key"
munged --foreground --key-file="$private/key" --socket="$private/socket" --pid-file="$private/munged.pid" \
    --log-file="$private/munged.log" --seed-file="$private/seed" 2> "$folder/munged.log" &
pids+=($!)

host=$(hostname -s)
memory=$(($(awk '/MemTotal/ { print $2 }' /proc/meminfo) / 1024 * 9 / 10))
export SLURM_CONF=$private/slurm.conf
cat > "$SLURM_CONF" << CONF
ClusterName=softjaw
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=16817
SlurmdPort=16818
AuthType=auth/munge
AuthInfo=socket=$private/socket
SlurmUser=root
SlurmdUser=root
SlurmctldPidFile=$private/slurmctld.pid
SlurmdPidFile=$private/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
StateSaveLocation=$private/state
SlurmdSpoolDir=$private/spool
# a container has no systemd and no cgroups of its own
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
SlurmdParameters=config_overrides
ReturnToService=2
KillWait=30
# a job that is forgotten cannot be asked how it ended
MinJobAge=86400
NodeName=$host NodeAddr=127.0.0.1 CPUs=2 RealMemory=$memory State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
mkdir -p "$private/state" "$private/spool"

slurmctld -D 2> "$folder/slurmctld.err" &
pids+=($!)
slurmd -D -N "$host" 2> "$folder/slurmd.err" &
pids+=($!)
for _ in $(seq 60); do
    [ "$(sinfo -h -o %t 2> /dev/null)" = idle ] && ready=1 && break
    for pid in "${pids[@]}"; do kill -0 "$pid" 2> /dev/null || fail "a daemon ended" "$(tail -n 5 "$folder"/*.log "$folder"/*.err)"; done
    sleep 1
done
[ -n "${ready:-}" ] || fail "the node is not idle after 60 s: $(sinfo -N -l 2>&1)" "logs: $folder"
say "$(sinfo --version), node $host with 2 CPUs is idle"
"$@"
