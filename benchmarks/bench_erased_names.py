"""What is left of a guess when labels say less: the public marker sets on real persons with words taken out of their
labels (public_marker_sets.toml, bench_public_sets.py).

    python benchmarks/bench_erased_names.py [WAYS...]    # needs BIODANCE_DATA; ways below, all without one

- numbers: M01, M02, ... in an order drawn by lot;
- sides: words of no language, with R_ or L_ before those that have a side;
- tongue: words of no language, with sides of a language that no list holds behind them;
- a part (asis, psis, knee, ankle, heel, toe): a word of no language for that part on both sides, the rest as it is;
- two: two such parts at once, every pair of them in turn.
"""

import os
import sys
import zlib
from collections import Counter
from itertools import combinations
from pathlib import Path

import numpy as np
from bench_public_sets import SETS, Person, judged, labelled, people_of

from biodance.lab.markers.guess import guess_set
from biodance.records import Markers

PARTS = {
    "asis": ("asis",),
    "psis": ("psis", "mid_psis"),
    "knee": ("knee_lateral", "knee_medial"),
    "ankle": ("ankle_lateral", "ankle_medial"),
    "heel": ("heel",),
    "toe": ("toe", "toe_lateral", "toe_medial"),
}
WAYS = ("numbers", "sides", "tongue", *PARTS, "two")
TONGUE = {"R": "ZIL", "L": "VOB", "": ""}
"""Words for right and left of no language."""


EVERY = 3
"""Each set is put on every third person, by turns."""


def erased(
    markers: Markers, truth: dict[str, str], parts: tuple[str, ...], seed: int
) -> tuple[Markers, dict[str, str]]:
    """Return the recording and its truth with the labels of some parts, or of all in one of the ways, replaced."""
    rng = np.random.default_rng(seed)
    numbers = iter(rng.permutation(len(truth)) + 1)
    words: dict[str, str] = {}
    gone = {place for part in parts if part in PARTS for place in PARTS[part]}
    new: dict[str, str] = {}
    for label, code in truth.items():
        first = code.split("|")[0].rpartition("@")[2]
        side = first[0] if first[1:2] in (".", ":") else ""
        place = first[2:] if side else first
        prefix, _, stem = label.rpartition(":")
        mirror = stem if not side else f"{place}{sorted(c.upper() for c in stem if c.upper() not in 'RLGDSXI')}"
        word = words.setdefault(mirror, "".join(rng.choice(list("qxzj"), 3)) + f"{len(words):02d}")
        if parts == ("numbers",):
            new[label] = f"M{next(numbers):02d}"
        elif parts == ("tongue",):
            new[label] = f"{word}{TONGUE[side]}"
        elif parts == ("sides",) or place in gone:
            new[label] = f"{prefix}:{side}_{word}" if side else f"{prefix}:{word}"
    taken = Counter(new.values())
    new = {label: f"{name}x{k}" if taken[name] > 1 else name for k, (label, name) in enumerate(new.items())}
    names = tuple(new.get(label, label) for label in markers.names)
    return Markers(names, markers.time, markers.xyz), {new.get(label, label): code for label, code in truth.items()}


def counted(name: str, person: Person, parts: tuple[str, ...]) -> tuple[Counter[str], list[str]]:
    """Return how many landmarks are right, wrong, left out, whether the set is guessed at all, and every error."""
    markers, truth = erased(*labelled(person, name), parts, zlib.crc32(f"{name}{parts}".encode()))
    guess = guess_set(markers)
    verdicts = {label: judged(code, guess.map.get(label) if guess.name else None) for label, code in truth.items()}
    wrong = [
        f"{label} ({truth[label]}) taken for {guess.map[label]}" for label, one in verdicts.items() if one == "wrong"
    ]
    return Counter(verdicts.values()) + Counter(["guessed" if guess.name else "refused"]), wrong or (
        [] if guess.name else [f"refused: {guess.doubts[0]}"]
    )


def main(data: Path, only: list[str]) -> None:
    """Print a line for every way, then every wrong landmark and refusal with how often it happens."""
    people = list(people_of(data).values())
    said: Counter[str] = Counter()
    print("| labels | sets on persons | guessed, % | landmarks right, % | wrong, % | left out or refused, % |")
    print("|---|---|---|---|---|---|")
    for way in only or WAYS:
        every = list(combinations(PARTS, 2)) if way == "two" else [(way,)]
        total: Counter[str] = Counter()
        for k, name in enumerate(SETS):
            for j in range(k % EVERY, len(people), EVERY):
                count, errors = counted(name, people[j], every[(k + j) % len(every)])
                total += count
                said.update(f"{way}: {name}: {error}" for error in errors)
        marks, sessions = (
            sum(total[word] for word in ("right", "wrong", "unknown")),
            total["guessed"] + total["refused"],
        )
        shares = " | ".join(f"{100 * total[word] / marks:.2f}" for word in ("right", "wrong", "unknown"))
        print(f"| {way} | {sessions} | {100 * total['guessed'] / sessions:.1f} | {shares} |", flush=True)
    print(*(f"{times} {text}" for text, times in said.most_common()), sep="\n")


if __name__ == "__main__":
    main(Path(os.environ["BIODANCE_DATA"]), sys.argv[1:])
