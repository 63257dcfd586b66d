#!/bin/sh
# Run a command in the emulated root: enter.sh DIRECTORY COMMAND...
# Check if this kernel allows it: enter.sh --allowed, which ends with 3 and the reason if not
#
# The command runs in a separate user, mount and process namespace. The emulator is registered in
# a binfmt_misc of that namespace (Linux 6.7 or newer), nothing on this machine is changed, and
# everything ends with the command. Network and trusted certificates are this machine's during the
# command; nothing of them stays in the root.
set -eu

if [ "${1:-}" = --allowed ]; then
    said=$(unshare --user --map-root-user --mount \
        mount -t binfmt_misc binfmt_misc /proc/sys/fs/binfmt_misc 2>&1) && exit 0
    echo "enter.sh: this kernel does not let users register an emulator (Linux 6.7 or newer does, with user namespaces): $said" >&2
    exit 3
fi
if [ "${1:-}" != --inside ]; then
    work=$(cd "$1" && pwd)
    shift
    [ -x "$work/qemu-aarch64-static" ] || { echo "enter.sh: no emulator in $work" >&2; exit 2; }
    exec unshare --user --map-root-user --mount --pid --fork --kill-child \
        "$0" --inside "$work" "$@"
fi
work=$2
shift 2
root=$work/root
mount --make-rprivate /
mount -t binfmt_misc binfmt_misc /proc/sys/fs/binfmt_misc 2>/dev/null || {
    echo "enter.sh: this kernel has no binfmt_misc for a user namespace (Linux 6.7 has)" >&2
    exit 3
}
magic='\x7fELF\x02\x01\x01\x00\x00\x00\x00\x00\x00\x00\x00\x00\x02\x00\xb7\x00'
mask='\xff\xff\xff\xff\xff\xff\xff\x00\xff\xff\xff\xff\xff\xff\xff\xff\xfe\xff\xff\xff'
# F: the emulator is opened now, so that it need not be in the root.
printf '%s' ":uavrt-arm64:M::$magic:$mask:$work/qemu-aarch64-static:F" \
    >/proc/sys/fs/binfmt_misc/register
mount --bind "$root" "$root"
mount -t proc proc "$root/proc"
mount --rbind /dev "$root/dev"
mount -t tmpfs tmpfs "$root/run"
for share in ${SHARE:-}; do # HOST:PLACE below the root
    mkdir -p "$root${share#*:}"
    mount --bind "${share%%:*}" "$root${share#*:}"
done
lend() { # FILE: at its place in the root, or where a link there leads to below /run
    [ -e "$1" ] || return 0
    target=$(readlink "$root$1") || target=
    target=${target#..}
    case $target in
        /run/*)
            mkdir -p "$(dirname "$root$target")"
            cp -L "$1" "$root$target" ;;
        '')
            cp -L "$1" "$root/run/lent/"
            [ -e "$root$1" ] || : >"$root$1"
            mount --bind "$root/run/lent/$(basename "$1")" "$root$1" ;;
    esac
}
mkdir -p "$root/run/lent"
lend /etc/resolv.conf
lend /etc/hosts
trusted=/etc/ssl/certs/ca-certificates.crt
[ ! -e $trusted ] || {
    cp -L $trusted "$root/run/lent/trusted"
    set -- PIP_CERT=/run/lent/trusted SSL_CERT_FILE=/run/lent/trusted "$@"
}
exec chroot "$root" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 "$@"
