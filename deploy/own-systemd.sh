#!/bin/sh
# A systemd of its own over a copy-on-write view of this system, for try-unit.sh and
# try-update.sh, which source this. Needs root, systemd and util-linux.
#
# It has processes, mounts, host name, IPC and cgroups of its own, and this machine's network. Of
# the units that this machine has enabled none starts. What it writes is in $work/upper, and is
# there at the next start, as on a disk; source_in_it is the source there.

# The inner half: process 1 of the new namespaces, which becomes systemd.
if [ "${1:-}" = --inside ]; then
    set -eu
    work=$2
    root=$work/root
    read -r leader _ </proc/self/stat # /proc is this machine's still
    mount --make-rprivate /
    mount -t overlay overlay -o "lowerdir=/,upperdir=$work/upper,workdir=$work/work" "$root"
    if [ ! -e "$work/begun" ]; then
        rm -rf "$root"/etc/systemd/system/*.wants
        ln -s /dev/null "$root/etc/systemd/system/systemd-modules-load.service" # of this kernel
        tr -d - </proc/sys/kernel/random/uuid >"$root/etc/machine-id"
        touch "$work/begun"
    fi
    mount -t proc proc "$root/proc"
    mount --bind "$root/proc/sys" "$root/proc/sys"
    mount -o remount,bind,ro "$root/proc/sys"
    mount -t sysfs -o ro sysfs "$root/sys"
    mount -t cgroup2 cgroup2 "$root/sys/fs/cgroup"
    mount -t tmpfs -o mode=755 tmpfs "$root/dev"
    mkdir "$root/dev/pts" "$root/dev/shm"
    for name in null zero full random urandom tty; do
        touch "$root/dev/$name"
        mount --bind "/dev/$name" "$root/dev/$name"
    done
    mount -t devpts -o newinstance,ptmxmode=0666,mode=620,gid=5 devpts "$root/dev/pts"
    ln -s pts/ptmx "$root/dev/ptmx"
    ln -s /proc/self/fd "$root/dev/fd"
    for name in dev/shm tmp run; do mount -t tmpfs -o mode=1777 tmpfs "$root/$name"; done
    chmod 755 "$root/run"
    echo "$leader" >"$work/leader"
    cd "$root"
    pivot_root . .
    umount -l .
    exec env -i container=uavrt PATH=/usr/sbin:/usr/bin:/sbin:/bin /lib/systemd/systemd \
        --system --show-status=no </dev/null
fi

source=$(cd "$(dirname "$0")/.." && pwd)
say() { printf '%s\n' "$(basename "$0" .sh): $*"; }
skip() { say "skipped: $*"; exit 77; }
[ "$(id -u)" = 0 ] || skip "it needs root"
[ -x /lib/systemd/systemd ] || skip "no systemd here: apt install systemd"
groups=$(findmnt -t cgroup2 -no TARGET | head -n 1)
[ -n "$groups" ] || skip "no unified cgroups (cgroup2) here"

work=$(mktemp -d)
mkdir -p "$work/upper/src" "$work/work" "$work/root" "$groups/$(basename "$work")"
system=
finish() {
    [ -z "$system" ] || cut_power
    for _ in 1 2 3 4 5; do # the last processes may still be going
        find "$groups/$(basename "$work")" -depth -type d -exec rmdir {} + 2>/dev/null || sleep 1
        [ -d "$groups/$(basename "$work")" ] || break
    done
    rm -rf --one-file-system "$work"
}
trap finish EXIT
trap 'exit 130' INT TERM

# The source as it is now, and the page, which needs Node to build.
source_in_it=/src
(cd "$source" && git ls-files -z src deploy native page pyproject.toml hatch_build.py README.md \
    LICENSE | tar -c --null -T - | tar -x -C "$work/upper/src")
[ ! -d "$source/src/uavrt/ground/static" ] ||
    cp -r "$source/src/uavrt/ground/static" "$work/upper/src/src/uavrt/ground/"

boot() { # starts it; returns when systemd has done what it starts with
    rm -f "$work/leader"
    sh -c 'echo $$ >"$1/cgroup.procs" && exec unshare --mount --pid --uts --ipc --cgroup --fork \
        --kill-child=KILL "$2/deploy/own-systemd.sh" --inside "$3"' \
        sh "$groups/$(basename "$work")" "$source" "$work" >>"$work/log" 2>&1 &
    system=$!
    tries=0
    until said=$(inside systemctl is-system-running 2>/dev/null) || [ "$said" = degraded ]; do
        tries=$((tries + 1))
        [ "$tries" -lt 120 ] && kill -0 "$system" 2>/dev/null ||
            { cat "$work/log"; say "systemd does not start here: $said"; exit 1; }
        sleep 0.5
    done
}
inside() { # COMMAND... in it
    [ -s "$work/leader" ] && nsenter -t "$(cat "$work/leader")" -a -- \
        env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 "$@"
}
cut_power() { # all of it is gone at once
    kill -KILL "$system" 2>/dev/null || true
    wait "$system" 2>/dev/null || true
    while [ -s "$work/leader" ] && [ -d "/proc/$(cat "$work/leader")" ]; do sleep 0.1; done
    system=
}
install_uavrt() { # OPTION... of install.sh
    inside env PYTHON=/usr/bin/python3 \
        PIP_CERT=/etc/ssl/certs/ca-certificates.crt "$source_in_it/deploy/install.sh" "$@"
}
