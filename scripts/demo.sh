#!/bin/sh
# The shipped models on their evidence: what a person would want to see, in a few seconds. Usage: demo.sh PROGRAM
set -eu
cd "$(dirname "$0")/.."
sherlog="${1:-build/bin/sherlog}"
identity=models/identity_resolution
fusion=models/information_fusion

title() {
  printf '\n== %s\n' "$1"
}
# Shows a command and runs it.
show() {
  printf '$ sherlog %s\n\n' "$*"
  "$sherlog" "$@"
}

title 'Who is who? Two equal plates and a mug; a plate was moved. The most probable explanation:'
show infer -m $identity/table1.mln -e $identity/kitchen_plates.db -q 'is(?o, ?n, stay), is(?o, ?n, move), is(?o, ?n, newview)' -q appear,disappear --method map

title 'A magazine was taken away, a bottle appeared. How sure can we be?'
show infer -m $identity/table1.mln -e $identity/kitchen_replaced.db -q appear,disappear

title 'What are the things on the breakfast table? All hints together, one consistent answer:'
show infer -m $fusion/fusion.mln -e $fusion/breakfast_scene.db -q object --method map

title 'And the white box: how probable is each of these?'
show infer -m $fusion/fusion.mln -e $fusion/breakfast_scene.db -q 'object(c1, Milk), object(c1, Sugar), object(c1, Salt), object(c1, Bowl)'

title 'Why milk?'
show explain -m $fusion/fusion.mln -e $fusion/breakfast_scene.db 'object(c1, Milk)' --top 5

title 'If a box is a box of cereals, which sign should the robot look for?'
show infer -m $fusion/fusion.mln -e $fusion/expected_logo.db -q 'goggles_Logo(c1, ?logo)'

title 'Four tables: 15 objects, things happen, the robot looks again. How often does it know which is which?'
show track evaluate --trials 60 --training-trials 150 --noise 0.05,0.1 --actions 1,3,5 --quiet

title 'What does not fit together is not answered, but explained:'
printf '$ sherlog infer -m %s/table1.mln -e %s/contradiction.db -q is,appear,disappear,hidden\n\n' $identity $identity
code=0
"$sherlog" infer -m $identity/table1.mln -e $identity/contradiction.db -q is,appear,disappear,hidden 2>&1 || code=$?
printf '(exit code %s)\n' "$code"
[ "$code" = 3 ]
