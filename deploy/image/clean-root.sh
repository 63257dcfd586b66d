#!/bin/sh
# Remove everything that differs from one build to the next: clean-root.sh ROOT [DIRECTORY...]
#
# pack.sh does this with its copy. It removes keys, certificates and traces of the computer that
# built it, caches, logs, and files that depend on the time. Bytecode with time stamps is removed
# below DIRECTORY, too. Files in home directories of an existing root go into the image, except
# keys and histories.
set -eu

root=$(cd "${1:?clean-root.sh ROOT [DIRECTORY...]}" && pwd)
[ -d "$root/etc" ] || { echo "clean-root.sh: $root has no /etc: give the directory of a root file system" >&2; exit 1; }
[ "$root" != / ] || { echo "clean-root.sh: refusing to change this computer's own root: give a copy" >&2; exit 1; }
shift
export LC_ALL=C
empty() { # PLACE...: the directory stays, for something may be mounted there
    for place in "$@"; do
        [ -L "$root/$place" ] || [ ! -d "$root/$place" ] ||
            find "$root/$place" -mindepth 1 -delete
    done
}
cd "$root"

# Of the trials and the emulator.
rm -rf src wheels shared .complete .finish-root
for place in tmp run var/log var/tmp; do
    [ -L $place ] || mkdir -p $place
done
empty tmp run var/log var/tmp

# Keys, identities, and who may enter.
rm -f etc/ssh/ssh_host_*_key* etc/ssl/private/ssl-cert-snakeoil.key etc/ssl/certs/ssl-cert-snakeoil.pem
rm -f var/lib/dbus/machine-id var/lib/systemd/random-seed var/lib/systemd/credential.secret
[ ! -e etc/machine-id ] || : >etc/machine-id
empty etc/NetworkManager/system-connections var/lib/NetworkManager var/lib/bluetooth \
    var/lib/dhcp var/lib/dhcpcd var/lib/urandom
rm -f etc/wpa_supplicant/wpa_supplicant*.conf
for home in root home/*; do
    rm -rf "$home/.ssh" "$home/.gnupg" "$home/.cache" "$home/.config/pip" "$home/.pip" \
        "$home/.netrc" "$home/.npmrc" "$home/.wget-hsts" "$home/.lesshst" "$home"/.*_history
done

# Caches, lists and earlier versions of files.
[ ! -d var/cache ] || find var/cache -type f ! -path 'var/cache/debconf/*.dat' -delete
empty var/lib/apt/lists var/backups
rm -f etc/passwd- etc/group- etc/shadow- etc/gshadow- etc/subuid- etc/subgid- var/lib/dpkg/*-old
# The day on which each account was made (days since 1970).
days=$((${SOURCE_DATE_EPOCH:-1767225600} / 86400))
[ ! -e etc/shadow ] || sed -i "s/^\([^:]*:[^:]*\):[1-9][0-9]*:/\1:$days:/" etc/shadow
python3 - "$root" "$@" <<'BYTECODE'
import sys
from pathlib import Path

for path in (path for place in sys.argv[1:] for path in Path(place).rglob("*.pyc")):
    if path.is_file() and path.read_bytes()[4:8] == bytes(4):  # PEP 552: by its source's time
        path.unlink()
BYTECODE

# Whom it trusts: those of its own packages and settings, as update-ca-certificates(8) has it.
listed() {
    if [ -e etc/ca-certificates.conf ]; then
        sed '/^[#!]/d; /^$/d; s|^|usr/share/ca-certificates/|' etc/ca-certificates.conf
    else
        find usr/share/ca-certificates -name '*.crt' 2>/dev/null | sort
    fi
    find usr/local/share/ca-certificates -name '*.crt' 2>/dev/null | sort
}
trusted=etc/ssl/certs/ca-certificates.crt
rm -f $trusted
listed | while read -r file; do
    [ -f "$file" ] || continue
    mkdir -p etc/ssl/certs
    sed -e '$a\' "$file" >>$trusted
done
