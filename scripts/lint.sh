#!/bin/sh
# The format of all sources, then clang-tidy over every compiled file. Usage: lint.sh JOBS
set -eu
cd "$(dirname "$0")/.."
jobs="${1:-2}"

scripts/sources.sh | xargs clang-format --dry-run --Werror
cmake --preset tidy >/dev/null
scripts/sources.sh | grep '\.cpp$' | grep -v '^tests/package/' |
  xargs -P "$jobs" -n 4 clang-tidy -p build/tidy --quiet --warnings-as-errors='*'
echo "lint: no finding"
