#!/bin/sh
# Make a drone's root of a Debian root where uavrt is installed: configure-root.sh ROOT [NAME]
#
# Read-only, with everything that changes on a data partition: settings and flights
# (/var/lib/uavrt), versions (/opt/uavrt), what is to be remembered of network and ssh. NAME is
# the hostname and the access point's: the page is at http://NAME.local:8650. Without it each
# computer names itself uavrt-XXXX at its first boot. Keys and passwords are made then, too, none
# is in the image; the page's first set-up changes them. Changes only files below ROOT; run it as
# often as you like.
set -eu

root=${1:?configure-root.sh ROOT [NAME]}
name=${2:-uavrt}
case $name in
    *[!a-z0-9-]* | -* | *- | '') echo "configure-root.sh: hostname $name is invalid: use a-z, 0-9 and -" >&2; exit 1 ;;
esac
[ -d "$root/etc" ] || { echo "configure-root.sh: $root has no /etc: give the directory of a root file system" >&2; exit 1; }
write() { # FILE [MODE]: what is on stdin, in place of a file that may be read-only, or a link
    mkdir -p "$(dirname "$root$1")"
    rm -f "$root$1"
    cat >"$root$1"
    chmod "${2:-644}" "$root$1"
}
# The name of one image is that of many computers, so it is given at each start.
given=
[ -z "${2:-}" ] || given=$name
enable() { # UNIT TARGET
    mkdir -p "$root/etc/systemd/system/$2.wants"
    ln -sf "/etc/systemd/system/$1" "$root/etc/systemd/system/$2.wants/$1"
}

write /etc/hostname <<HOST
$name
HOST
rm -f "$root/etc/hosts"
ln -s /run/uavrt-hosts "$root/etc/hosts"
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
write /etc/NetworkManager/conf.d/uavrt.conf <<'NETWORK'
[main]
hostname-mode=none
NETWORK
write /etc/ssh/sshd_config.d/uavrt.conf <<'SSH'
HostKey /data/ssh/ssh_host_ed25519_key
AuthorizedKeysFile /data/ssh/authorized_keys
PasswordAuthentication no
KbdInteractiveAuthentication no
PermitRootLogin no
AllowUsers drone
SSH
# Who logs in has shown a key, and is to update the drone; there is no password to ask for.
write /etc/sudoers.d/uavrt 440 <<'SUDO'
drone ALL=(ALL) NOPASSWD: ALL
SUDO

# The page on the drone is a ground station of its own: a link to it, and the key of the first boot.
settings=$root/var/lib/uavrt/uavrt.toml
[ ! -f "$settings" ] || sed -i 's|^direct_links = \[\]$|direct_links = ["udpin://127.0.0.1:14560"]|
    s|^# key_file =$|key_file = "/var/lib/uavrt/command.key"|' "$settings"

write /usr/local/sbin/uavrt-first-boot 755 <<'FIRST'
#!/bin/sh
# What each computer has for itself, made once: the size of its card, and keys.
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
[ -e /data/uavrt/command.key ] || { head -c 32 /dev/urandom | od -An -v -tx1 | tr -d ' \n' >/data/uavrt/command.key
    chown uavrt:uavrt /data/uavrt/command.key; }
chown -R uavrt:uavrt /data/uavrt
touch /data/.first-boot-done
sync
FIRST
write /usr/local/sbin/uavrt-identity 755 <<IDENTITY
#!/bin/sh
# Who this computer is, at each start: name, passwords, and what the first set-up on the page
# has left in set-up.conf, which is taken once. uavrt-identity [DATA [SCREEN]]
set -eu
umask 077
data=\${1:-/data} given=$given
IDENTITY
cat >>"$root/usr/local/sbin/uavrt-identity" <<'IDENTITY'
mkdir -p "$data/network"
secret() { head -c 4096 /dev/urandom | tr -dc 'abcdefghijkmnpqrstuvwxyz23456789' | head -c "$1"; }
# As the page's own user, so that a link it could have put there leads nowhere; and whatever does
# not look as it should is left out: root believes nothing that a service has written.
# A pipe, which would never end, is given up after a few seconds: the boot waits for this.
handed() { timeout -k 1 3 runuser -u uavrt -- head -c 20000 "$data/uavrt/$1" 2>/dev/null || :; }
set_up=$(handed set-up.conf | tr '\000' '\001')
wanted() { printf '%s\n' "$set_up" | sed -nE "s#^$1=($2)\$#\1#p" | head -n 1; }
kept() { sed -nE "s/^$1=(.*)\$/\1/p" "$data/identity" 2>/dev/null | head -n 1; }
either() { [ -n "$1" ] && printf '%s' "$1" || printf '%s' "$2"; }

name=$(either "$(wanted name '[a-z0-9]([a-z0-9-]{0,30}[a-z0-9])?')" "$(kept name)")
wifi=$(either "$(wanted wifi_password '[A-Za-z0-9._-]{8,63}')" "$(kept wifi_password)")
page=$(either "$(wanted page_password '[A-Za-z0-9._-]{8,63}')" "$(kept page_password)")
name=$(either "$name" "${given:-uavrt-$(secret 4)}")
wifi=$(either "$wifi" "$(secret 12)")
page=$(either "$page" "$(secret 12)")

told=$(printf 'name=%s\nwifi_password=%s\npage_password=%s' "$name" "$wifi" "$page")
if [ "$told" != "$(cat "$data/identity" 2>/dev/null)" ]; then
    cat >"$data/network/uavrt-access-point.nmconnection" <<AP
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
    printf 'UAVRT_GROUND_PASSWORD=%s\nUAVRT_HOST_NAME=%s.local\nUAVRT_ACCESS_POINT="WIFI:T:WPA;S:%s;P:%s;;"\n' \
        "$page" "$name" "$name" "$wifi" >"$data/page.env"
    printf 'Wi-Fi %s, password %s\npage http://%s.local:8650, password %s\n' \
        "$name" "$wifi" "$name" "$page" >"$data/access-point.txt"
    # Last, as what says that the others are right; and whole, whatever happens meanwhile.
    printf '%s\n' "$told" >"$data/identity.new"
    sync "$data/identity.new" "$data/page.env" "$data/network/uavrt-access-point.nmconnection"
    mv "$data/identity.new" "$data/identity"
fi
# Whose updates are taken: the first key counts, later ones come by an update that it has signed.
keys=$(handed update-keys.pem | tr '\000' '\001')
case $keys in
    "-----BEGIN PUBLIC KEY-----"*) [ -e "$data/opt/update-keys.pem" ] || {
        printf '%s\n' "$keys" >"$data/opt/update-keys.pem"
        chmod 644 "$data/opt/update-keys.pem"
    } ;;
esac
# Who may log in, as the user drone. Once: a service that somebody has broken into must not
# let them in as root.
key=$(wanted ssh_key '(ssh-(ed25519|rsa)|ecdsa-sha2-nistp256) [A-Za-z0-9+/]{60,1400}={0,2}( [A-Za-z0-9@._-]{1,80})?')
[ -z "$key" ] || [ -e "$data/ssh/authorized_keys" ] || {
    mkdir -p "$data/ssh"
    printf '%s\n' "$key" >"$data/ssh/authorized_keys.new"
    chmod 644 "$data/ssh/authorized_keys.new"
    mv "$data/ssh/authorized_keys.new" "$data/ssh/authorized_keys"
    chmod 755 "$data/ssh"
}
sync "$data"
rm -rf "$data/uavrt/set-up.conf" "$data/uavrt/update-keys.pem"
# Until somebody has set it up, a screen at this computer says how to come to the page.
screen=${2:-/run/issue.d/uavrt.issue}
mkdir -p "$(dirname "$screen")" && chmod 755 "$(dirname "$screen")"
if [ -e "$data/uavrt/set-up-done" ]; then
    rm -f "$screen"
else
    { cat "$data/access-point.txt"
    "$data/opt/venv/bin/segno" --compact "WIFI:T:WPA;S:$name;P:$wifi;;" 2>/dev/null || :
    } >"$screen"
fi
[ "$data" = /data ] || exit 0 # elsewhere for a trial: this computer stays as it is
mkdir -p "$data/home/drone" && chown drone:drone "$data/home/drone" && chmod 755 "$data/home"
printf '127.0.0.1 localhost\n127.0.1.1 %s\n::1 localhost\n' "$name" >/run/uavrt-hosts
chmod 644 /run/uavrt-hosts
printf '%s' "$name" >/proc/sys/kernel/hostname
IDENTITY
for unit in first-boot identity; do
    case $unit in
        first-boot)
            what="size of the card, keys" after= before=uavrt-identity.service
            once='ConditionPathExists=!/data/.first-boot-done' ;;
        identity) what="name and passwords" after=uavrt-first-boot.service before= once= ;;
    esac
    write /etc/systemd/system/uavrt-$unit.service <<UNIT
[Unit]
Description=uavrt: $what of this computer
$once
DefaultDependencies=no
RequiresMountsFor=/data
After=local-fs.target $after
Before=NetworkManager.service avahi-daemon.service ssh.service uavrt.service uavrt-page.service sysinit.target $before

[Service]
Type=oneshot
RemainAfterExit=yes
ExecStart=/usr/local/sbin/uavrt-$unit
StandardOutput=journal+console

[Install]
WantedBy=sysinit.target
UNIT
    enable uavrt-$unit.service sysinit.target
done
write /etc/systemd/system/uavrt-page.service <<'UNIT'
[Unit]
Description=uavrt: the ground station's page on the drone's own Wi-Fi
After=network.target uavrt.service
RequiresMountsFor=/data /opt/uavrt

[Service]
EnvironmentFile=/data/page.env
ExecStart=/opt/uavrt/venv/bin/uavrt ground --page --no-browser --listen 0.0.0.0 --host-name ${UAVRT_HOST_NAME} --set-up /var/lib/uavrt/uavrt.toml --mavlink udpout://127.0.0.1:14560 --output /var/lib/uavrt/flights --command-key /var/lib/uavrt/command.key --component-id 192
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
