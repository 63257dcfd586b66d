#!/bin/sh
# Pack a root into a bootable image: pack.sh ROOT IMAGE
#
# GPT with an EFI partition (systemd-boot, kernel, initrd), a read-only root, and a data partition
# that grows at the first boot. Needs no root rights: mkfs.ext4 -d, mtools. The same root gives the
# same bytes: identifiers come from the root's own digest, times from SOURCE_DATE_EPOCH. Nor does it
# tell of the computer that built it (clean-root.sh).
set -eu

root=${1:?pack.sh ROOT IMAGE} image=${2:?pack.sh ROOT IMAGE}
root=$(cd "$root" && pwd)
for tool in sfdisk mkfs.ext4 debugfs mkfs.vfat mcopy python3; do
    PATH=$PATH:/usr/sbin:/sbin command -v $tool >/dev/null ||
        { echo "pack.sh: no $tool: sudo apt install fdisk e2fsprogs dosfstools mtools python3" >&2; exit 1; }
done
PATH=$PATH:/usr/sbin:/sbin
export SOURCE_DATE_EPOCH="${SOURCE_DATE_EPOCH:-1767225600}" # 2026
export E2FSPROGS_FAKE_TIME="$SOURCE_DATE_EPOCH" TZ=UTC LC_ALL=C
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT TERM

# What moves to the data partition; the root keeps empty places for it.
cp -a --reflink=auto "$root" "$work/root"
mkdir -p "$work/data"
for pair in var/lib/uavrt:uavrt opt/uavrt:opt; do
    if [ -d "$work/root/${pair%%:*}" ]; then
        mv "$work/root/${pair%%:*}" "$work/data/${pair#*:}"
    fi
    mkdir -p "$work/root/${pair%%:*}" "$work/data/${pair#*:}"
done
mkdir -p "$work/data/network" "$work/data/ssh" "$work/data/timesync"
"$(dirname "$0")/clean-root.sh" "$work/root" "$work/data"
find "$work/root" "$work/data" -exec touch -hd "@$SOURCE_DATE_EPOCH" {} +

digest=$(cd "$work" && find root data -type f -exec sha256sum {} + | sort -k2 | sha256sum | cut -c-32)
uuid() { # a UUID that only depends on the contents and a word
    printf '%s %s' "$digest" "$1" | sha256sum |
        sed 's/^\(........\)\(....\)\(...\)\(...\)\(............\).*/\1-\2-4\3-8\4-\5/'
}
size_mib() { echo $(($(du -sm --apparent-size "$1" | cut -f1) * 13 / 10 + ${2})); }
root_mib=$(size_mib "$work/root" 64) data_mib=$(size_mib "$work/data" 256) efi_mib=${EFI_MIB:-192}
group_id() { sed -n "s/^$1:[^:]*:\([0-9]*\):.*/\1/p" "$work/root/etc/group"; }
owners() { # DIRECTORY: all is root's, whoever built it, but for what Debian gives to groups
    (cd "$1" && find . \( ! -uid 0 -o ! -gid 0 \) | sed 's/^\.//; s/"/""/g') |
        while read -r path; do
            printf 'set_inode_field "%s" uid 0\nset_inode_field "%s" gid 0\n' "${path:-/}" "${path:-/}"
        done
    for pair in etc/shadow:shadow:0100640 etc/gshadow:shadow:0100640 \
        usr/sbin/unix_chkpwd:shadow:0102755 usr/bin/chage:shadow:0102755 \
        usr/bin/expiry:shadow:0102755 usr/bin/ssh-agent:_ssh:0102755 \
        usr/lib/dbus-1.0/dbus-daemon-launch-helper:messagebus:0104754; do
        file=${pair%%:*} group=${pair#*:} mode=${pair##*:}
        group=$(group_id "${group%:*}")
        [ -e "$1/$file" ] && [ -n "$group" ] || continue
        printf 'set_inode_field "/%s" gid %s\nset_inode_field "/%s" mode %s\n' \
            "$file" "$group" "$file" "$mode"
    done
}
filesystem() { # DIRECTORY FILE MIB LABEL
    truncate -s "$3M" "$2"
    mkfs.ext4 -q -F -d "$1" -L "$4" -U "$(uuid "$4")" -m 1 -E "hash_seed=$(uuid "$4 hash"),root_owner=0:0" \
        -O ^metadata_csum_seed,^orphan_file "$2"
    # mke2fs keeps when each file was read, and its inode changed, where it was built.
    (cd "$1" && find . -mindepth 1 | sed 's/^\.//; s/"/""/g') |
        while read -r path; do
            for field in atime ctime; do
                printf 'set_inode_field "%s" %s @%s\n' "$path" $field "$SOURCE_DATE_EPOCH"
                printf 'set_inode_field "%s" %s_extra 0\n' "$path" $field
            done
        done >"$2.times"
    owners "$1" >>"$2.times"
    debugfs -w -f "$2.times" "$2" >/dev/null 2>&1
}
filesystem "$work/root" "$work/root.ext4" "$root_mib" uavrt-root
filesystem "$work/data" "$work/data.ext4" "$data_mib" uavrt-data

truncate -s "${efi_mib}M" "$work/efi"
mkfs.vfat --invariant -F 32 -n UAVRT-EFI -i "$(uuid efi | cut -c-8)" "$work/efi" >/dev/null
kernel=$(find "$root/boot" -name 'vmlinuz-*' 2>/dev/null | sort | tail -1)
if [ -n "$kernel" ]; then
    version=${kernel##*/vmlinuz-}
    mkdir -p "$work/esp/EFI/BOOT" "$work/esp/loader/entries"
    cp "$root/usr/lib/systemd/boot/efi/systemd-bootaa64.efi" "$work/esp/EFI/BOOT/BOOTAA64.EFI"
    cp "$kernel" "$work/esp/linux"
    cp "$root/boot/initrd.img-$version" "$work/esp/initrd"
    printf 'timeout 0\ndefault uavrt.conf\n' >"$work/esp/loader/loader.conf"
    printf 'title uavrt\nlinux /linux\ninitrd /initrd\noptions root=PARTUUID=%s ro %s\n' \
        "$(uuid partition-root)" "${KERNEL_OPTIONS:-quiet console=tty0}" >"$work/esp/loader/entries/uavrt.conf"
    find "$work/esp" -exec touch -hd "@$SOURCE_DATE_EPOCH" {} +
    (cd "$work/esp" && mcopy -s -p -m -i "$work/efi" EFI loader linux initrd ::)
else
    echo "pack.sh: no kernel in $root/boot: the image does not boot by itself" >&2
fi

total_mib=$((1 + efi_mib + root_mib + data_mib + 1))
rm -f "$image"
truncate -s "${total_mib}M" "$image"
sfdisk -q "$image" <<TABLE
label: gpt
label-id: $(uuid disk)
unit: sectors
start=1MiB, size=${efi_mib}MiB, type=C12A7328-F81F-11D2-BA4B-00A0C93EC93B, name=uavrt-efi, uuid=$(uuid partition-efi)
size=${root_mib}MiB, type=B921B045-1DF0-41C3-AF44-4C6F280D3FAE, name=uavrt-root, uuid=$(uuid partition-root)
size=${data_mib}MiB, type=0FC63DAF-8483-4772-8E79-3D69D8477DE4, name=uavrt-data, uuid=$(uuid partition-data)
TABLE
at=1
for part in "efi:$efi_mib" "root.ext4:$root_mib" "data.ext4:$data_mib"; do
    dd if="$work/${part%%:*}" of="$image" bs=1M seek=$at conv=notrunc,sparse status=none
    at=$((at + ${part#*:}))
done
echo "$image: $total_mib MiB, $digest"
