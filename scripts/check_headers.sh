#!/usr/bin/env bash
# Compiles every header of the library alone: each must include what it uses, without a warning.
# (Precompiled headers hide both in a normal build.)
#
#   scripts/check_headers.sh <build directory>    the compiler is $CXX, default clang++
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")/.."
build=${1:?usage: scripts/check_headers.sh <build directory>}

# The include paths of the library, as the build itself uses them.
includes=$(sed -n 's/^ *INCLUDES = //p' "$build/build.ninja" | tr ' ' '\n' | sed 's/^-isystem$//' |
  grep '^[-/]' | sed 's/^-I//' | sort -u | sed 's/^/-isystem /')
# And its warnings, without what only GCC has to leave out.
warnings=$(sed -n 's/^ *FLAGS = //p' "$build/build.ninja" | tr ' ' '\n' | grep '^-W' |
  grep -v '^-Wno-' | sort -u)

check() {
  # As -include, so that #pragma once is not in the main file.
  ${CXX:-clang++} -std=c++20 -fsyntax-only -DEIGEN_MAX_ALIGN_BYTES=16 $WARNINGS $INCLUDES \
    -include "mapjoin/$1" -x c++ /dev/null || {
    echo "does not compile alone: src/$1" >&2
    return 1
  }
}
export -f check
export WARNINGS="-Werror $warnings"
export INCLUDES="-I $build/include $includes"

find src -name '*.h' -not -path 'src/cli/*' -printf '%P\0' | sort -z |
  xargs -0 -n 1 -P "$(nproc)" bash -c 'check "$0"'
