#!/bin/sh
# Builds the fuzzers and runs each for some seconds. Usage: fuzz.sh SECONDS JOBS
# libFuzzer where clang is there or can be installed; else the same functions under a driver of our own.
set -eu
cd "$(dirname "$0")/.."
seconds="${1:-60}"
jobs="${2:-2}"

preset=fuzz
if ! command -v clang++ >/dev/null && ! scripts/setup.sh fuzz; then
  echo "fuzz: no clang; using the standalone driver" >&2
  preset=fuzz-standalone
fi
cmake --preset "$preset"
names="$(for source in tests/fuzz/*_fuzz.cpp; do basename "$source" .cpp; done)"
# shellcheck disable=SC2086  # a list of targets
cmake --build --preset "$preset" -j "$jobs" --target $names

mkdir -p build/fuzz/work
for name in $names; do
  mkdir -p "build/fuzz/work/$name"
  echo "fuzz: $name for $seconds seconds"
  (cd build/fuzz/work && "../tests/$name" -max_total_time="$seconds" -timeout=20 -max_len=4096 "$name" \
    ../../../tests/fuzz/corpus ../../../tests/regression)
done
