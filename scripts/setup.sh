#!/usr/bin/env bash
# Installs what mapjoin is built with (Debian 12, Ubuntu 22.04 and later).
#
#   scripts/setup.sh        what scripts/packages.txt lists
#   scripts/setup.sh --ci   and what scripts/packages-ci.txt lists
#
# Does nothing, quickly, when everything is there.
set -euo pipefail

scripts=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

lists=("$scripts/packages.txt")
case "${1:-}" in
  "") ;;
  --ci) lists+=("$scripts/packages-ci.txt") ;;
  *)
    echo "usage: scripts/setup.sh [--ci]" >&2
    exit 2
    ;;
esac

say() { echo "setup: $*" >&2; }

if ! command -v dpkg-query >/dev/null; then
  say "this is not Debian or Ubuntu; install the equivalents of these packages yourself:"
  grep -hv '^#' "${lists[@]}" | grep . | sed 's/^/  /' >&2
  exit 1
fi

installed() {
  [[ $(dpkg-query -W -f='${db:Status-Abbrev}' "$1" 2>/dev/null) == ii* ]]
}

# A line may name alternatives, a|b: any one of them will do.
missing=()
while read -r line; do
  found=no
  for package in ${line//|/ }; do
    if installed "$package"; then found=yes; fi
  done
  if [[ $found == no ]]; then missing+=("$line"); fi
done < <(cat "${lists[@]}" | sed 's/#.*//' | grep -v '^[[:space:]]*$')

if [[ ${#missing[@]} -eq 0 ]]; then
  echo "setup: everything is installed"
  exit 0
fi
echo "setup: to install: ${missing[*]}"

as_root=()
if [[ $(id -u) -ne 0 ]]; then
  if ! command -v sudo >/dev/null; then
    say "cannot install packages: neither root nor sudo. Ask an administrator to run:"
    say "  apt-get install ${missing[*]%%|*}"
    exit 1
  fi
  as_root=(sudo)
fi
apt() {
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -y -q "$@" </dev/null
}

if ! apt update; then
  say "could not refresh the package lists (no network?); trying with those at hand"
fi

packages=()
for line in "${missing[@]}"; do
  choice=
  for package in ${line//|/ }; do
    if [[ -z $choice ]] && apt-cache show "$package" >/dev/null 2>&1; then choice=$package; fi
  done
  packages+=("${choice:-${line%%|*}}")
done

if ! apt install --no-install-recommends "${packages[@]}"; then
  say "apt-get could not install: ${packages[*]}"
  say "mapjoin needs Debian 12, Ubuntu 22.04 or later (on Ubuntu with 'universe' enabled)."
  exit 1
fi
echo "setup: installed ${packages[*]}"
