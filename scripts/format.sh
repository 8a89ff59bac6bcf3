#!/usr/bin/env bash
# Formats all C++ files with clang-format 14, the version CI checks with.
#
#   scripts/format.sh           rewrites what needs it
#   scripts/format.sh --check   changes nothing, fails if something needs it
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")/.."

clang_format=
for candidate in clang-format-14 clang-format; do
  if [[ -z $clang_format ]] && command -v "$candidate" >/dev/null; then clang_format=$candidate; fi
done
if [[ -z $clang_format ]]; then
  echo "format: clang-format is not installed (scripts/setup.sh --ci installs it)" >&2
  exit 1
fi
version=$("$clang_format" --version)
if [[ $version != *"version 14."* ]]; then
  echo "format: warning: $version may differ from clang-format 14" >&2
fi

case "${1:-}" in
  "") mode=(-i) ;;
  --check) mode=(--dry-run --Werror) ;;
  *)
    echo "usage: scripts/format.sh [--check]" >&2
    exit 2
    ;;
esac

find src tests examples benchmarks cmake -name '*.h' -print0 -o -name '*.cpp' -print0 |
  sort -z | xargs -0 --no-run-if-empty "$clang_format" "${mode[@]}"
