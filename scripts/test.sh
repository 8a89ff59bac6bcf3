#!/usr/bin/env bash
# Sets up, builds and runs all tests. The last line says how many passed, failed and were skipped.
#
#   scripts/test.sh [preset] [options of ctest...]    preset: release (default), debug, asan, ...
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")/.."

preset=release
if [[ $# -gt 0 && $1 != -* ]]; then
  preset=$1
  shift
fi
jobs=$(nproc)
build=build/$preset

scripts/setup.sh
cmake --preset "$preset"
cmake --build --preset "$preset" --parallel "$jobs"

# Every test program leaves its results there as XML, so that tests can be counted one by one.
results=$build/test-results
rm -rf "$results"

status=0
ctest --preset "$preset" --parallel "$jobs" "$@" || status=$?

# Sums one attribute of the <testsuites> elements.
sum() {
  { cat "$results"/*.xml 2>/dev/null || true; } | sed -n "s/^<testsuites .*\\b$1=\"\\([0-9]*\\)\".*/\\1/p" |
    awk '{ total += $1 } END { print total + 0 }'
}
tests=$(sum tests)
disabled=$(sum disabled)
failed=$(($(sum failures) + $(sum errors)))
skipped=$({ cat "$results"/*.xml 2>/dev/null || true; } | grep -c '<skipped' || true)
passed=$((tests - failed - skipped - disabled))

# A test program that crashed, or an example that failed, has left no results.
if [[ $status -ne 0 && $failed -eq 0 ]]; then failed=1; fi
if [[ $tests -eq 0 && $status -eq 0 ]]; then
  echo "no tests were run" >&2
  status=1
fi

echo
echo "$passed passed, $failed failed, $((skipped + disabled)) skipped"
exit "$status"
