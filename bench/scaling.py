#!/usr/bin/env python3
"""Writes models that have to stay linear: many components, one long component, one hub. Nothing is timed here.

    bench/scaling.py FOLDER [SCALE]
    sherlog infer -m FOLDER/hub.mln -e FOLDER/hub.db -q R --method mcsat --max-seconds 20

SCALE 1 (the default) gives the sizes below, .1 a tenth: ten times the size is to take ten times as long.
"""
import os
import random
import sys


def constants(letter, count):
    return ",".join(f"{letter}{i}" for i in range(count))


def main():
    folder = sys.argv[1]
    scale = float(sys.argv[2]) if len(sys.argv) > 2 else 1.0
    os.makedirs(folder, exist_ok=True)
    random.seed(1)

    def write(name, model, evidence):
        for ending, text in (("mln", model), ("db", evidence)):
            with open(os.path.join(folder, f"{name}.{ending}"), "w") as out:
                out.write(text)

    people = int(200_000 * scale)
    domain = f"person = {{{constants('P', people)}}}\n"
    three = "A(person)\nB(person)\nC(person)\n"
    # Components of three atoms: each is drawn as a whole.
    write("people", three + "0.7 A(x)\n1.2 A(x) => B(x)\n0.9 B(x) => C(x)\n", domain)
    # The same, but a weight that keeps them from it, and a hard formula.
    write("heavy", three + "700 A(x)\n1.2 A(x) => B(x)\n0.9 B(x) => C(x)\n!A(x) v !B(x) v C(x).\n", domain)
    write("hard", three + "1 A(x)\n-1 B(x)\n0.5 C(x)\nA(x) v B(x) v C(x).\n!A(x) v !B(x).\n", domain)
    # One component of 300,000 atoms in a row.
    steps = int(300_000 * scale)
    write("chain", "Next(t,t)\nS(t)\n0.8 Next(a,b) => (S(a) <=> S(b))\n0.1 S(a)\n",
          "".join(f"Next(T{i},T{i + 1})\n" for i in range(steps - 1)))
    # One gate with 100,000 inputs, soft and hard.
    hub = f"c = {{{constants('C', int(100_000 * scale))}}}\n"
    write("hub", "R(c)\nE(c)\n-3.0 R(x)\n2.0 EXIST x (R(x))\n0.3 E(x) => R(x)\n", hub)
    write("hubhard", "R(c)\n-3.0 R(x)\nEXIST x (R(x)).\n", hub)
    # 100,000 communities of four.
    friends = []
    for c in range(int(100_000 * scale)):
        pairs = [(0, 1), (1, 2), (2, 3)] + ([(0, 3)] if random.random() < 0.5 else [])
        friends += [f"Friends(P{c}_{a},P{c}_{b})\n" for a, b in pairs]
    write("smokers", "Friends(person,person)\nSmokes(person)\nCancer(person)\n1.4 !Smokes(x)\n2.3 !Cancer(x)\n"
          "1.5 Smokes(x) => Cancer(x)\n1.1 Friends(x,y) => (Smokes(x) <=> Smokes(y))\n", "".join(friends))


main()
