#!/usr/bin/env bash
# From a fresh clone to a picture: sets up, builds the program, and lets it simulate a world, cut it
# into local maps, join them and compare the result with the truth.
#
#   scripts/demo.sh [directory for the results]    default: demo_output
set -euo pipefail

output=$(realpath -m "${1:-"$(dirname "${BASH_SOURCE[0]}")/../demo_output"}")
cd "$(dirname "${BASH_SOURCE[0]}")/.."

scripts/setup.sh
cmake --preset release
cmake --build --preset release --parallel "$(nproc)" --target mapjoin_program

echo
build/release/mapjoin demo --output "$output"

echo
pictures=$(find "$output" -name '*.svg' | sort)
if [[ -z $pictures ]]; then
  echo "demo: no picture was written to $output" >&2
  exit 1
fi
echo "The picture is here (open it in a web browser):"
while read -r picture; do echo "  $picture"; done <<<"$pictures"
