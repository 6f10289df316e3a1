#!/bin/sh
# Installs the Debian packages that are missing, and nothing where none is. Usage: setup.sh build|format|lint|fuzz
set -eu

packages="g++ cmake ninja-build pkg-config libboost-dev libeigen3-dev libfmt-dev nlohmann-json3-dev libcli11-dev
          coinor-libcbc-dev libceres-dev libsqlite3-dev libgtest-dev libgmock-dev libbenchmark-dev libnanoflann-dev
          libopencv-core-dev libopencv-imgproc-dev libopencv-imgcodecs-dev libpng-dev libyaml-cpp-dev libopencv-video-dev"
case "${1:-build}" in
  build) ;;
  format) packages="clang-format" ;;
  lint) packages="$packages clang clang-tidy clang-format" ;;
  fuzz) packages="$packages clang" ;;
  *) echo "setup.sh: unknown set of packages '$1'" >&2; exit 2 ;;
esac

if ! command -v dpkg-query >/dev/null; then
  echo "setup: this is not a Debian system; these packages (or their like) are needed:" $packages >&2
  exit 0  # CMake says what it cannot find
fi

find_missing() {
  missing=""
  for package in $packages; do
    case "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true)" in
      installed) ;;
      *) missing="$missing $package" ;;
    esac
  done
}

find_missing
[ -n "$missing" ] || exit 0

as_root=""
if [ "$(id -u)" != 0 ]; then
  if ! command -v sudo >/dev/null; then
    echo "setup: packages are missing and there is neither root nor sudo to install them; as root, run:" >&2
    echo "  apt-get update && apt-get install -y --no-install-recommends$missing" >&2
    exit 1
  fi
  as_root="sudo"
fi

# Two make targets may come here side by side: one of them waits, and then finds nothing missing.
exec 9>"${TMPDIR:-/tmp}/sherlog-setup.lock.$(id -u)"
flock 9
find_missing
[ -n "$missing" ] || exit 0
echo "setup: installing$missing" >&2
export DEBIAN_FRONTEND=noninteractive
$as_root apt-get update -qq </dev/null
# shellcheck disable=SC2086  # a list of packages
$as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing </dev/null >&2
