#!/bin/sh
# Lists all C++ sources of the project.
cd "$(dirname "$0")/.."
find mln grounding inference learning perception_bridge cli tests bench examples sherlog.h \
  \( -name '*.h' -o -name '*.cpp' \) 2>/dev/null | sort
