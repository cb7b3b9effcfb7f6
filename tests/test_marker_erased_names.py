"""Public marker sets on real persons (public_marker_sets.toml): what is guessed of their labels, and what is left of a
guess when labels say less.

- numbers: M01, M02, ... in an order drawn by lot;
- sides: words of no language, with R_ or L_ before those that have a side;
- tongue: words of no language, with sides of a language that no list holds behind them;
- a part (asis, psis, knee, ankle, heel, toe): a word of no language for that part on both sides, the rest as it is.
"""

import os
import zlib
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from public_marker_sets import SETS, Person, judged, labelled, people_of

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
TONGUE = {"R": "ZIL", "L": "VOB", "": ""}
"""Words for right and left of no language."""


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


@pytest.fixture(scope="module")
def people() -> list[Person]:
    """The persons who stand in public recordings."""
    folder = os.environ.get("BIODANCE_DATA")
    if not folder:
        pytest.skip("BIODANCE_DATA does not name the folder with real recordings")
    return list(people_of(Path(folder)).values())


@pytest.mark.parametrize(
    ("parts", "guessed"), [((), 84), (("numbers",), 39), (("sides",), 60), (("knee",), 83), (("toe",), 83)]
)
def test_of_labels_that_say_less_next_to_nothing_false_is_guessed(
    people: list[Person], parts: tuple[str, ...], guessed: int
) -> None:
    """99 sets, each on one of the persons by turns."""
    total, guesses = Counter[str](), 0
    for k, name in enumerate(SETS):
        markers, truth = labelled(people[k % len(people)], name)
        if parts:
            markers, truth = erased(markers, truth, parts, zlib.crc32(f"{name}{parts}".encode()))
        guess = guess_set(markers)
        guesses += bool(guess.name)
        total.update(judged(code, guess.map.get(label) if guess.name else None) for label, code in truth.items())
    assert guesses >= guessed
    assert total["wrong"] <= 0.015 * (total["right"] + total["wrong"] + total["unknown"])
