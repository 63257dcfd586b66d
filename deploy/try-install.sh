#!/bin/sh
# Install into a fresh Debian, twice: `sudo deploy/try-install.sh [install.sh's options]`.
# Needs debootstrap, root and the package servers; takes about five minutes. It changes only one
# temporary directory, which is removed at the end.
set -eu

source=$(cd "$(dirname "$0")/.." && pwd)
root=$(mktemp -d)
finish() {
    umount "$root/dev" "$root/proc" 2>/dev/null || true
    rm -rf --one-file-system "$root"
}
trap finish EXIT
trap 'exit 130' INT TERM

debootstrap --variant=minbase --include=ca-certificates bookworm "$root" >/dev/null
mkdir "$root/src"
git -C "$source" archive HEAD | tar -x -C "$root/src"
# The network and the trust of this machine.
cp /etc/resolv.conf /etc/hosts "$root/etc/"
cp /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/"
mount -t proc proc "$root/proc"
mount --bind /dev "$root/dev"
chroot "$root" useradd --create-home pi

install() {
    chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin SUDO_USER=pi \
        PIP_CERT=/etc/ssl/certs/ca-certificates.crt \
        NODE_EXTRA_CA_CERTS=/etc/ssl/certs/ca-certificates.crt \
        /src/deploy/install.sh "$@"
}
files() {
    chroot "$root" find /etc /opt /var/lib/uavrt -type f ! -path '*__pycache__*' \
        -printf '%p %T@\n' | sort
}
install "$@"
files >"$root/tmp/first"
install "$@"
files >"$root/tmp/second"
cmp "$root/tmp/first" "$root/tmp/second"
chroot "$root" systemd-analyze verify /etc/systemd/system/uavrt.service 2>/dev/null ||
    echo "no systemd-analyze in this root: the unit was not verified"
echo "installed; the second run changed nothing"
