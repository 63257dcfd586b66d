#!/bin/sh
# A Debian root for 64-bit ARM below DIRECTORY/root, and an emulator for it: make-root.sh DIRECTORY
#
# This machine's apt fetches the packages with separate lists, checks their signatures
# with this machine's Debian keys, and unpacks them. Their scripts are not run, because that is
# slow in the emulator (debootstrap's second stage); the parts that uavrt needs are done here.
# Needs no root rights. An existing root is kept, unless other packages are requested now. LIST
# names another list than packages.txt, PACKAGES adds packages, COMPONENTS their origin (main).
# make-root.sh --emulator DIRECTORY makes only the emulator.
set -eu

fail() { printf '%s\n' "make-root.sh: $*" >&2; exit 1; }
emulator() {
    [ ! -x "$work/qemu-aarch64-static" ] || return 0
    found=$(command -v qemu-aarch64-static || true)
    if [ -n "$found" ]; then
        cp "$found" "$work/"
    else
        # Of this machine's own architecture, unpacked, not installed.
        (cd "$work" && APT_CONFIG= apt-get download -qq qemu-user-static 2>/dev/null &&
            dpkg-deb --fsys-tarfile qemu-user-static_*.deb | tar -x ./usr/bin/qemu-aarch64-static &&
            mv usr/bin/qemu-aarch64-static . && rm -rf usr qemu-user-static_*.deb) ||
            fail "no emulator: sudo apt install qemu-user-static"
    fi
}
if [ "$1" = --emulator ]; then
    work=$2
    emulator
    exit 0
fi
work=$1
suite=${SUITE:-bookworm} components=${COMPONENTS:-main} mirror=${MIRROR:-http://deb.debian.org/debian}
here=$(cd "$(dirname "$0")" && pwd)
packages="$(sed 's/#.*//' "${LIST:-$here/packages.txt}" | tr '\n' ' ') ${PACKAGES:-}"
keys=/usr/share/keyrings/debian-archive-keyring.gpg
[ -e $keys ] || fail "no $keys: sudo apt install debian-archive-keyring"
wanted=$(printf '%s\n' "$suite" "$mirror" "$components" "$packages" | tr -s ' ' | sha256sum)
is() { [ "$(cat "$1" 2>/dev/null)" = "$wanted" ]; }
is "$work/apt/wanted" || rm -rf "$work/apt"
mkdir -p "$work/apt/lists/partial" "$work/apt/cache/archives/partial" "$work/apt/empty"
: >"$work/apt/status"
echo "$wanted" >"$work/apt/wanted"
printf 'deb [arch=arm64 signed-by=%s] %s %s %s\n' "$keys" "$mirror" "$suite" "$components" >"$work/apt/sources"
cat >"$work/apt/apt.conf" <<APT
APT::Architecture "arm64";
APT::Architectures { "arm64"; };
APT::Sandbox::User "";
APT::Install-Recommends "false";
Dir::State "$work/apt";
Dir::State::lists "$work/apt/lists";
Dir::State::status "$work/apt/status";
Dir::Cache "$work/apt/cache";
Dir::Etc::sourcelist "$work/apt/sources";
Dir::Etc::sourceparts "$work/apt/empty";
Dir::Etc::preferencesparts "$work/apt/empty";
Debug::NoLocking "true";
APT
export APT_CONFIG="$work/apt/apt.conf"
if ! is "$work/apt/done"; then
    # shellcheck disable=SC2086
    { apt-get update -qq && apt-get install -y -qq --download-only $packages >/dev/null; } ||
        fail "no packages from $mirror: is the network there, and MIRROR right?"
    echo "$wanted" >"$work/apt/done"
fi
emulator
root=$work/root
! is "$root/.complete" || exit 0

rm -rf "$root"
mkdir -p "$root/usr/bin" "$root/usr/sbin" "$root/usr/lib" "$root/var/lib/dpkg/info"
for name in bin sbin lib; do ln -s "usr/$name" "$root/$name"; done
for deb in $(printf '%s\n' "$work"/apt/cache/archives/*.deb | LC_ALL=C sort); do
    dpkg-deb --fsys-tarfile "$deb" |
        tar -xp --keep-directory-symlink --no-same-owner -C "$root"
    {
        dpkg-deb -f "$deb" | sed '/^Package:/a Status: install ok installed'
        echo
    } >>"$root/var/lib/dpkg/status"
    package=$(dpkg-deb -f "$deb" Package)
    dpkg-deb --fsys-tarfile "$deb" | tar -t | sed 's/^\.//; s/^$/\/./' \
        >"$root/var/lib/dpkg/info/$package.list"
done
# What the packages' own scripts would have done.
[ -e "$root/etc/passwd" ] || cp "$root/usr/share/base-passwd/passwd.master" "$root/etc/passwd"
[ -e "$root/etc/group" ] || cp "$root/usr/share/base-passwd/group.master" "$root/etc/group"
[ -e "$root/bin/sh" ] || ln -s dash "$root/bin/sh"
ln -sf mawk "$root/usr/bin/awk"
for alternative in gcc:cc; do
    [ ! -e "$root/usr/bin/${alternative%:*}" ] ||
        ln -sf "${alternative%:*}" "$root/usr/bin/${alternative#*:}"
done
mkdir -p "$root/proc" "$root/dev" "$root/sys" "$root/run" "$root/tmp" "$root/etc"
chmod 1777 "$root/tmp"
echo "$wanted" >"$root/.complete"
