#!/bin/sh
# Writes docs/commands.md from the program's own help, and checks that every relative link in the documents leads to a file.
# Usage: docs.sh PROGRAM [--check]   (--check: fails where docs/commands.md is not what would be written)
set -eu
program="$1"
cd "$(dirname "$0")/.."

write_commands() {
  echo '# Commands'
  echo
  echo 'Written by `make docs` from the program itself.'
  echo
  echo '```text'
  "$program" --help
  echo '```'
  for command in check ground infer explain learn xval convert advise perceive 'scenes generate' 'scenes import' 'scenes export' 'scenes list' \
      'scenes show' 'scenes where' 'scenes history' 'scenes on' 'scenes counts' 'scenes times' 'scenes evidence' \
      'scenes reprocess' 'scenes sigmas' 'scenes mapping' 'scenes schema' 'scenes check' 'track simulate' 'track learn' \
      'track evaluate' 'track resolve' 'track show'; do
    echo
    echo "## sherlog $command"
    echo
    echo '```text'
    # shellcheck disable=SC2086  # a command may be two words
    "$program" $command --help
    echo '```'
  done
}

new="$(mktemp)"
trap 'rm -f "$new"' EXIT
write_commands | sed 's/[[:space:]]*$//' >"$new"
if [ "${2:-}" = --check ]; then
  cmp -s "$new" docs/commands.md || { echo "docs: docs/commands.md is out of date; run 'make docs'" >&2; exit 1; }
else
  cat "$new" >docs/commands.md  # not a copy: the temporary file is private
fi

broken=0
for document in $(find . -name '*.md' -not -path './build/*' -not -path './.git/*'); do
  for link in $(grep -o '](\([^)# ]*\)' "$document" | sed 's/^](//' | grep -v '^[a-z]*:' || true); do
    [ -n "$link" ] || continue
    if [ ! -e "$(dirname "$document")/$link" ]; then
      echo "docs: $document: no such file: $link" >&2
      broken=1
    fi
  done
done
exit "$broken"
