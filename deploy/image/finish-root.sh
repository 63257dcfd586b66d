#!/bin/sh
# Do for booting what the packages' own scripts would do: finish-root.sh DIRECTORY
#
# Runs after deploy/arm64/make-root.sh and install-uavrt.sh, before configure-root.sh, in the
# emulator: users and groups, files made from templates, the list of kernel modules, the initrd,
# the choice of services, and uavrt's service as its own user. Run it as often as you like.
#
# The initrd gets most drivers, because the board is not known yet; with
# INITRD_MODULES="virtio_pci virtio_blk ext4" only those (quick; for the emulator).
set -eu

if [ "${1:?finish-root.sh DIRECTORY}" != --inside ]; then
    work=$(cd "$1" && pwd)
    enter=$(cd "$(dirname "$0")/../arm64" && pwd)/enter.sh
    cp "$0" "$work/root/.finish-root"
    "$enter" "$work" /bin/sh /.finish-root --inside "${SOURCE_DATE_EPOCH:-1767225600}" \
        "${INITRD_MODULES:-}"
    rm "$work/root/.finish-root"
    # Bytecode, which a read-only root and a service without rights can never write: without it
    # each start would compile everything again. It is the same for every processor, so this
    # machine's Python makes it if it is of the same version. Not by times: pack.sh sets them.
    magic='import importlib.util as u; print(u.MAGIC_NUMBER.hex())'
    there=$("$enter" "$work" python3 -c "$magic")
    find "$work/root/usr/lib" "$work/root/opt" -name __pycache__ -prune -exec rm -rf {} +
    set -- -m compileall -q --invalidation-mode unchecked-hash -x '/(tests?|idlelib|lib2to3)/'
    for place in "$work"/root/usr/lib/python3.* "$work/root/opt/uavrt/versions/source/lib"; do
        if [ "$(python3 -c "$magic")" = "$there" ]; then
            PYTHONHASHSEED=0 python3 "$@" -s "$work/root" -p / "$place"
        else
            "$enter" "$work" /usr/bin/env PYTHONHASHSEED=0 python3 "$@" "${place#"$work/root"}"
        fi
    done
    exit 0
fi
export SOURCE_DATE_EPOCH="$2" TZ=UTC LC_ALL=C DEBIAN_FRONTEND=noninteractive
say() { printf '%s\n' "finish-root.sh: $*"; }
begin() { [ -e "$2" ] || { mkdir -p "$(dirname "$2")" && cp "$1" "$2"; }; }
program=/opt/uavrt/venv/bin/uavrt
[ -x "$program" ] || { echo "finish-root.sh: no $program: install-uavrt.sh comes first" >&2; exit 1; }

say "templates"
begin /usr/share/libc-bin/nsswitch.conf /etc/nsswitch.conf
begin /usr/share/openssh/sshd_config /etc/ssh/sshd_config
begin /usr/share/base-files/profile /etc/profile
begin /usr/share/base-files/dot.profile /root/.profile
for file in /lib/firmware/regulatory.db /lib/firmware/regulatory.db.p7s; do # of wireless-regdb
    [ ! -e $file-debian ] || [ -e $file ] || ln -s "${file##*/}-debian" $file
done
ln -sf /usr/share/zoneinfo/Etc/UTC /etc/localtime
echo Etc/UTC >/etc/timezone
# As pam-auth-update writes them where it can ask debconf.
pam() { # FILE KIND CONTROL LINES...
    file=/etc/pam.d/common-$1 kind=$2 control=$3
    shift 3
    {
        [ -z "$control" ] || printf '%s [%s] pam_unix.so\n' "$kind" "$control"
        [ -n "$control" ] || printf '%s [default=1] pam_permit.so\n' "$kind"
        printf "$kind %s\n" "requisite pam_deny.so" "required pam_permit.so" "$@"
    } >"$file"
}
pam auth auth "success=1 default=ignore"
pam account account "success=1 new_authtok_reqd=done default=ignore"
pam password password "success=1 default=ignore"
pam session session "" "required pam_unix.so" "optional pam_systemd.so"
pam session-noninteractive session "" "required pam_unix.so"
ldconfig
rm -rf /var/cache/ldconfig # of inodes and times
chmod u=rwx,g=,o= /root
rm -rf /var/run /var/lock && ln -s /run /var/run
ln -s /run/lock /var/lock

say "users"
# Debian's packages make these by adduser; the others are in /usr/lib/sysusers.d.
mkdir -p /etc/sysusers.d
cat >/etc/sysusers.d/uavrt.conf <<'USERS'
u sshd - "Privilege separation of ssh" /run/sshd
u avahi - "Avahi" /run/avahi-daemon
g netdev -
g _ssh -
u uavrt - "Finds radio-tagged animals" /var/lib/uavrt
m uavrt dialout
m uavrt plugdev
u drone 1000 "Who looks after this computer" /data/home/drone /bin/bash
m drone uavrt
USERS
systemd-sysusers
pwconv
grpconv

say "services"
mkdir -p /etc/systemd/system-preset
cat >/etc/systemd/system-preset/00-uavrt.preset <<'PRESET'
# What a drone's computer starts; nothing else does.
enable avahi-daemon.*
enable dbus.*
enable getty@.service
enable NetworkManager.service
enable NetworkManager-dispatcher.service
enable ssh.service
enable systemd-timesyncd.service
enable uavrt*.service
enable wpa_supplicant.service
disable *
PRESET
"$program" service install --user uavrt --directory /var/lib/uavrt 2>/dev/null |
    sed '/ failed: /d; s/^/  /' # no systemd is here to be told
systemctl preset-all 2>&1 | sed '/is masked, ignoring/d; s/^/  /'
systemctl set-default multi-user.target 2>/dev/null
systemd-hwdb --usr update

for kernel in /boot/vmlinuz-*; do
    version=${kernel#/boot/vmlinuz-}
    say "initrd for $version (some minutes in the emulator)"
    depmod "$version"
    printf '%s\n' ${3:-} >/etc/initramfs-tools/modules
    mkdir -p /etc/initramfs-tools/conf.d
    echo "MODULES=${3:+list}" | sed 's/=$/=most/' >/etc/initramfs-tools/conf.d/uavrt
    mkinitramfs -o "/boot/initrd.img-$version" "$version"
done
