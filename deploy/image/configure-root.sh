#!/bin/sh
# Make a drone's root of a Debian root where uavrt is installed: configure-root.sh ROOT [NAME]
#
# Read-only, with everything that changes on a data partition: settings and flights
# (/var/lib/uavrt), versions (/opt/uavrt), what is to be remembered of network and ssh. NAME
# (default uavrt) is the hostname and the access point's: the page is at http://NAME.local:8650.
# Keys and passwords are made at the first boot, none is in the image. Changes only files below
# ROOT; run it as often as you like.
set -eu

root=${1:?configure-root.sh ROOT [NAME]}
name=${2:-uavrt}
case $name in
    *[!a-z0-9-]* | -* | *- | '') echo "configure-root.sh: $name is no hostname: a-z, 0-9 and -" >&2; exit 1 ;;
esac
[ -d "$root/etc" ] || { echo "configure-root.sh: $root is no root: it has no /etc" >&2; exit 1; }
write() { # FILE [MODE]: what is on stdin
    mkdir -p "$(dirname "$root$1")"
    cat >"$root$1"
    chmod "${2:-644}" "$root$1"
}
enable() { # UNIT TARGET
    mkdir -p "$root/etc/systemd/system/$2.wants"
    ln -sf "/etc/systemd/system/$1" "$root/etc/systemd/system/$2.wants/$1"
}

write /etc/hostname <<HOST
$name
HOST
write /etc/hosts <<HOSTS
127.0.0.1 localhost
127.0.1.1 $name
::1 localhost
HOSTS
# Empty, not missing (machine-id(5)): each boot has an identity of its own in memory, as the
# journal has, and no boot takes itself for the first.
rm -f "$root/etc/machine-id"
write /etc/machine-id </dev/null
write /etc/fstab <<'FSTAB'
LABEL=uavrt-root /               ext4  ro,noatime,errors=remount-ro 0 1
LABEL=uavrt-data /data           ext4  rw,noatime,errors=remount-ro,x-systemd.before=uavrt-first-boot.service 0 2
/data/uavrt      /var/lib/uavrt  none  bind,x-systemd.requires-mounts-for=/data 0 0
/data/opt        /opt/uavrt      none  bind,x-systemd.requires-mounts-for=/data 0 0
/data/network    /etc/NetworkManager/system-connections none bind,x-systemd.requires-mounts-for=/data 0 0
tmpfs            /var/lib/systemd tmpfs nosuid,nodev,size=1% 0 0
/data/timesync   /var/lib/systemd/timesync none bind,x-systemd.requires-mounts-for=/data 0 0
tmpfs            /tmp            tmpfs nosuid,nodev,size=25% 0 0
tmpfs            /var/tmp        tmpfs nosuid,nodev,size=10% 0 0
tmpfs            /var/log        tmpfs nosuid,nodev,size=5% 0 0
tmpfs            /var/lib/NetworkManager tmpfs nosuid,nodev,size=1% 0 0
FSTAB
mkdir -p "$root/data" "$root/var/lib/uavrt" "$root/opt/uavrt" "$root/var/lib/NetworkManager" \
    "$root/etc/NetworkManager/system-connections" "$root/var/lib/systemd/timesync"
ln -sf /run/NetworkManager/resolv.conf "$root/etc/resolv.conf"
write /etc/systemd/journald.conf.d/uavrt.conf <<'JOURNAL'
# The journal is in memory: a flight's own logs are in its directory.
[Journal]
Storage=volatile
RuntimeMaxUse=32M
JOURNAL
write /etc/ssh/sshd_config.d/uavrt.conf <<'SSH'
HostKey /data/ssh/ssh_host_ed25519_key
PermitRootLogin no
SSH

# The page on the drone is a ground station of its own: a link to it, and the key of the first boot.
settings=$root/var/lib/uavrt/uavrt.toml
[ ! -f "$settings" ] || sed -i 's|^direct_links = \[\]$|direct_links = ["udpin://127.0.0.1:14560"]|
    s|^# key_file =$|key_file = "/var/lib/uavrt/command.key"|' "$settings"

write /usr/local/sbin/uavrt-first-boot 755 <<'FIRST'
#!/bin/sh
# What each computer has for itself, made once: the size of its card, keys, passwords.
set -eu
umask 077
data=$(findmnt -no SOURCE /data)
disk=/dev/$(lsblk -no PKNAME "$data")
number=$(cat "/sys/class/block/${data#/dev/}/partition")
echo ', +' | sfdisk --no-reread -N "$number" "$disk" && partx -u "$disk" && resize2fs "$data" ||
    echo "the data partition keeps its size"
mkdir -p /data/uavrt /data/opt /data/network /data/ssh /data/timesync
chmod 755 /data /data/opt /data/timesync
[ -e /data/ssh/ssh_host_ed25519_key ] || ssh-keygen -q -t ed25519 -N '' -f /data/ssh/ssh_host_ed25519_key
secret() { tr -dc 'abcdefghijkmnpqrstuvwxyz23456789' </dev/urandom | head -c "$1"; }
name=$(cat /etc/hostname)
if [ ! -e /data/access-point.txt ]; then
    wifi=$(secret 12) page=$(secret 12)
    cat >/data/network/uavrt-access-point.nmconnection <<AP
[connection]
id=uavrt-access-point
type=wifi
autoconnect=true

[wifi]
mode=ap
ssid=$name

[wifi-security]
key-mgmt=wpa-psk
psk=$wifi

[ipv4]
method=shared
address1=10.42.0.1/24

[ipv6]
method=disabled
AP
    printf 'UAVRT_GROUND_PASSWORD=%s\nUAVRT_ACCESS_POINT="WIFI:T:WPA;S:%s;P:%s;;"\n' \
        "$page" "$name" "$wifi" >/data/page.env
    printf 'Wi-Fi %s, password %s\npage http://%s.local:8650, password %s\n' \
        "$name" "$wifi" "$name" "$page" >/data/access-point.txt
fi
[ -e /data/uavrt/command.key ] || { head -c 32 /dev/urandom | od -An -v -tx1 | tr -d ' \n' >/data/uavrt/command.key
    chown uavrt:uavrt /data/uavrt/command.key; }
chown -R uavrt:uavrt /data/uavrt
touch /data/.first-boot-done
sync
FIRST
write /etc/systemd/system/uavrt-first-boot.service <<'UNIT'
[Unit]
Description=uavrt: keys and passwords of this computer
ConditionPathExists=!/data/.first-boot-done
DefaultDependencies=no
RequiresMountsFor=/data
After=local-fs.target
Before=NetworkManager.service ssh.service uavrt.service uavrt-page.service sysinit.target

[Service]
Type=oneshot
RemainAfterExit=yes
ExecStart=/usr/local/sbin/uavrt-first-boot
StandardOutput=journal+console

[Install]
WantedBy=sysinit.target
UNIT
enable uavrt-first-boot.service sysinit.target
write /etc/systemd/system/uavrt-page.service <<UNIT
[Unit]
Description=uavrt: the ground station's page on the drone's own Wi-Fi
After=network.target uavrt.service
RequiresMountsFor=/data /opt/uavrt

[Service]
EnvironmentFile=/data/page.env
ExecStart=/opt/uavrt/venv/bin/uavrt ground --page --no-browser --listen 0.0.0.0 --host-name $name.local --mavlink udpout://127.0.0.1:14560 --output /var/lib/uavrt/ground --command-key /var/lib/uavrt/command.key --component-id 192
User=uavrt
WorkingDirectory=/var/lib/uavrt
Restart=always
RestartSec=2
NoNewPrivileges=yes
ProtectSystem=strict
ReadWritePaths=/var/lib/uavrt
ProtectHome=yes
PrivateTmp=yes
Nice=10
CPUQuota=30%

[Install]
WantedBy=multi-user.target
UNIT
enable uavrt-page.service multi-user.target
