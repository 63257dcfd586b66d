#!/bin/sh
# Make an image for a drone's computer with 64-bit ARM, from a new Debian or an existing root.
#
#   deploy/image/build.sh [options] IMAGE
#
#   --directory DIR    working directory (default IMAGE.work, 3 GB); finished steps are kept there,
#                      and a stopped run continues with the first missing step
#   --anew             repeat all steps
#   --name NAME        hostname and access point (default: each computer names itself uavrt-XXXX)
#   --update-key FILE  public key (PEM) that signs updates for `uavrt update`
#   --ros2             also install the gateway to ROS 2
#   --from ROOT        use a Debian 12 or Raspberry Pi OS 12 for 64-bit ARM (a directory or a tar)
#                      instead of a new Debian; it is copied, and root owns all files of the image
#   --wifi             also install the firmware of common Wi-Fi chips (Debian's
#                      non-free-firmware); most have no access point without it
#   --packages "A B"   also install these packages of Debian
#
# Needs no root rights, but Linux 6.7 or newer (for the emulator), the package servers, and
# git, fdisk, e2fsprogs, dosfstools, mtools and uavrt's own environment (make setup).
# INITRD_MODULES and KERNEL_OPTIONS are explained in finish-root.sh and pack.sh. The image is for
# computers with UEFI; docs/how-to/make-an-image.md says what else a Raspberry Pi needs.
set -eu

say() { printf '%s\n' "build.sh: $*"; }
fail() { say "$*" >&2; exit 1; }
image= directory= name= from= key= anew= packages= components=${COMPONENTS:-main}
ros2= wifi="firmware-brcm80211 firmware-realtek firmware-atheros firmware-iwlwifi firmware-misc-nonfree wireless-regdb"
while [ $# -gt 0 ]; do
    case $1 in
        -h | --help) sed -n '2,/^set -eu/{/^set -eu/d; s/^# \{0,1\}//; p}' "$0"; exit 0 ;;
        --anew) anew=1; shift; continue ;;
        --ros2) ros2=--ros2; shift; continue ;;
        --wifi) packages="$packages $wifi" components="main non-free-firmware"; shift; continue ;;
        -*) [ $# -ge 2 ] || fail "$1 needs a value, or is unknown (--help)" ;;
        *) [ -z "$image" ] || fail "two images, $image and $1: give one (--help)"
            image=$1; shift; continue ;;
    esac
    case $1 in
        --directory) directory=$2 ;;
        --name) name=$2 ;;
        --update-key) key=$2 ;;
        --from) from=$2 ;;
        --packages) packages="$packages $2" ;;
        *) fail "unknown option $1 (--help)" ;;
    esac
    shift 2
done
[ -n "$image" ] || fail "which file is to be the image? deploy/image/build.sh uavrt.img (--help)"

# What would stop it late stops it now.
here=$(cd "$(dirname "$0")" && pwd)
source=$(cd "$here/../.." && pwd)
arm64=$source/deploy/arm64
PATH=$PATH:/usr/sbin:/sbin
for pair in git:git sfdisk:fdisk mkfs.ext4:e2fsprogs debugfs:e2fsprogs mkfs.vfat:dosfstools \
    mcopy:mtools python3:python3 apt-get:apt dpkg-deb:dpkg unshare:util-linux; do
    command -v "${pair%%:*}" >/dev/null || fail "no ${pair%%:*}: sudo apt install ${pair#*:}"
done
command -v "${PYTHON:-$source/.venv/bin/python}" >/dev/null || fail "no ${PYTHON:-$source/.venv/bin/python}: make setup"
[ -z "$key" ] || [ -r "$key" ] || fail "no file $key: give the public key (PEM), docs/how-to/update-the-drone.md"
[ -z "$from" ] || [ -e "$from" ] || fail "no $from: give a directory or a tar of a root"
[ -z "$from" ] || [ -z "$packages" ] || fail "--wifi and --packages are for a new Debian: install them in $from first"
said=$("$arm64/enter.sh" --allowed 2>&1) || fail "the emulator cannot run here: $said"
work=${directory:-$image.work}
mkdir -p "$work/done"
work=$(cd "$work" && pwd)
[ -z "$anew" ] || rm -f "$work"/done/*

# Each step leaves the sum of what it was made of; one that is done again spoils all after it.
number=0 sum=
step() { # NAME INGREDIENTS COMMAND...
    number=$((number + 1))
    mark=$work/done/$number-$1
    sum=$(printf '%s\n' "$sum" "$2" | sha256sum | cut -c-64)
    [ "$(cat "$mark" 2>/dev/null)" != "$sum" ] || { say "$number. $1: done already"; return 0; }
    say "$number. $1"
    for later in "$work"/done/*; do
        after=${later##*/}
        [ "${after%%-*}" = '*' ] || [ "${after%%-*}" -lt $number ] || rm -f "$later"
    done
    shift 2
    "$@"
    echo "$sum" >"$mark"
}
list() { sed 's/#.*//' "$@" | tr -s ' \n' '  '; }
new_root() {
    COMPONENTS=$components PACKAGES="$(list "$here/packages.txt")$packages" "$arm64/make-root.sh" "$work"
}
check_root() { # what finish-root.sh and pack.sh rely on
    root=$work/root
    [ -d "$root/etc" ] && [ -e "$root/var/lib/dpkg/status" ] ||
        fail "$from is no Debian: it has no etc, or no var/lib/dpkg/status"
    python=$root/usr/bin/python3.11
    [ -e "$python" ] || fail "$from has no Python 3.11: take Debian 12 or Raspberry Pi OS 12, with python3"
    [ "$(od -An -tx1 -j18 -N2 "$python" | tr -d ' ')" = b700 ] || fail "$from is not for 64-bit ARM (arm64)"
    there=" $(sed -n '/^Package: /{s///;h;}; /^Status: .* ok installed$/{x;p;x;}' "$root/var/lib/dpkg/status" | tr '\n' ' ') "
    missing=
    for package in $(list "$arm64/packages.txt" "$here/packages.txt"); do
        case $package in linux-image-*) continue ;; esac # it may have a kernel of its own
        case $there in *" $package "*) ;; *) missing="$missing $package" ;; esac
    done
    [ -z "$missing" ] || fail "$from lacks packages; in it: sudo apt install$missing"
    ls "$root"/boot/vmlinuz-* >/dev/null 2>&1 || fail "$from has no kernel (boot/vmlinuz-…)"
}
given_root() {
    "$arm64/make-root.sh" --emulator "$work"
    rm -rf "$work/root" "$work/failed"
    mkdir -p "$work/root"
    set -- --anchored --exclude=./dev/\* --exclude=dev/\* --exclude=./proc/\* --exclude=./sys/\* --exclude=./run/\*
    if [ -d "$from" ]; then
        { tar -c --one-file-system "$@" -C "$from" . || touch "$work/failed"; } |
            tar -xp --no-same-owner -C "$work/root"
        [ ! -e "$work/failed" ] || fail "$from cannot be read whole: as root, or give a tar of it"
    else
        tar -xp --no-same-owner "$@" -C "$work/root" -f "$from" || fail "$from is no tar of a root"
    fi
    check_root
    (cd "$work/root" && mkdir -p dev proc sys run tmp)
}
installed() {
    set -- $ros2
    [ -z "$key" ] || set -- "$@" --update-key "$key"
    "$arm64/install-uavrt.sh" "$work" "$@"
}
contents() { (cd "$source" && git ls-files -z "$@" | xargs -0 cat | sha256sum); }

if [ -n "$from" ]; then
    step root "$from $(stat -c '%Y %s' "$from") $(stat -c %Y "$from/var/lib/dpkg/status" 2>/dev/null)" given_root
else
    step root "$components $packages $(contents deploy/arm64/make-root.sh deploy/arm64/packages.txt deploy/image/packages.txt)" new_root
fi
step uavrt "$ros2 $([ -z "$key" ] || cat "$key") $(contents src deploy/install.sh deploy/dds-wheel.sh \
    deploy/locks native page pyproject.toml hatch_build.py)" installed
step services "${INITRD_MODULES:-} $(contents deploy/image/finish-root.sh)" "$here/finish-root.sh" "$work"
say "4. settings"
"$here/configure-root.sh" "$work/root" ${name:+"$name"}
say "5. image"
"$here/pack.sh" "$work/root" "$image"
