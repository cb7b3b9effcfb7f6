"""Marker sets: which session is tracked with no file written by hand, and how many landmarks a guess gets right when
the labels of the known sets are spelled in other laboratories' ways.

    python benchmarks/bench_marker_sets.py sessions    # needs BIODANCE_DATA
    python benchmarks/bench_marker_sets.py names       # needs BIODANCE_DATA
    python benchmarks/bench_marker_sets.py labels      # needs BIODANCE_DATA; exchanged labels, in copies, too
"""

import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from biodance.diagnosis.diagnosis import ABOUT
from biodance.lab.markers.guess import guess_set
from biodance.lab.markers.sets import MarkerSet, landmark, read_marker_set
from biodance.lab.read import read_trial
from biodance.library import read_toml
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial_result import TrialResult
from biodance.records import Markers, Trial

SESSIONS = {
    **{name: (f"biomechzoo/{name}/*.c3d",) for name in ("HC030A", "HC031A", "HC032A", "HC038A", "HC044A", "HC050A")},
    "HC055A": ("biomechzoo/HC055A/*.c3d",),
    "c3d_parser": ("c3d_parser/static/*.c3d", "c3d_parser/dynamic/*.c3d"),
    "c3d_parser_QCMAS": ("c3d_parser_QCMAS/*.c3d",),
    "c3d_parser_Sydney": ("c3d_parser_Sydney/*.c3d",),
    "gaitalytics small": ("gaitalytics/test_small.c3d",),
    "gaitalytics treadmill": ("gaitalytics/treadmill_no_events.c3d",),
    "pycgm": ("pycgm/*.c3d",),
    "adl_gait": ("adl_gait/*.c3d",),
    "biomdp CMJ": ("biomdp/kistler_CMJ_1plate.c3d",),
    "biomdp standing": ("biomdp/kistler_COP.c3d",),
}
"""Sessions of BIODANCE_DATA with recorded persons."""


def sessions(data: Path) -> None:
    """Print session, set, of every trial the RMS marker distance of all and of legs, and the first line of its page
    as far as the trials that were not judged and the checks outside their limits.
    """
    from biodance.errors import BiodanceError
    from biodance.lab.session.read import read_session
    from biodance.pipeline.diagnosis import diagnose_session
    from biodance.pipeline.session import examine

    print("| session | marker set | unseen parts | trial: RMS of all (legs), mm | first line |\n|---|---|---|---|---|")
    for name, patterns in SESSIONS.items():
        if len(sys.argv) > 2 and not any(word in name for word in sys.argv[2:]):
            continue
        with tempfile.TemporaryDirectory() as folder:
            for file in (one for pattern in patterns for one in sorted(data.glob(pattern))):
                os.symlink(file, Path(folder) / file.name)
            try:
                result = examine(read_session(folder, subject_name=None))
                said = next(one.text for one in diagnose_session(result).diagnosis.attention if one.about == ABOUT)
            except BiodanceError as error:
                print(f"| {name} | - | - | - | refused: {error} |", flush=True)
                continue
        first = said.partition(" Also: ")[0].partition("; ")[0]
        worn = ", ".join(sorted({trial.trial.worn or "none" for trial in result.trials}))
        print(f"| {name} | {worn} | {_unseen(result)} | {'; '.join(map(_near, result.trials))} | {first} |", flush=True)


def _unseen(result: SessionResult) -> str:
    """Return the parts of the body that no marker shows."""
    body = result.body
    pairs = zip(body.joints, body.free, strict=True) if body else ()
    held = {joint.name.rsplit("_", 1)[0] for joint, free in pairs if not free}
    return "trunk, arms" if "trunk" in held else "arms" if held else "-"


def _near(one: TrialResult) -> str:
    """Return how near the markers of a trial are to the body, or why it was not followed."""
    if one.fit is None:
        refused = next((step.text for step in one.steps if step.status != "done"), "?")
        return f"{one.name}: {refused[:160]}"
    legs = one.fit.by_group.get("legs", np.nan)
    return f"{one.name}: {1e3 * one.fit.total_rms:.1f} ({1e3 * legs:.1f})"


_WRISTS = {side: (f"{side}WRA", f"{side}WRB") for side in "LR"}
EXCHANGES = {
    "left wrist": (_WRISTS["L"],),
    "right wrist": (_WRISTS["R"],),
    "both wrists": (_WRISTS["L"], _WRISTS["R"]),
    "head, sides": (("LFHD", "RFHD"), ("LBHD", "RBHD")),
    "head, ends": (("LBHD", "LFHD"), ("RBHD", "RFHD")),
    "head, front": (("LFHD", "RFHD"),),
    "pelvis, front": (("LASI", "RASI"),),
    "knees": (("LKNE", "RKNE"),),
}
"""What is exchanged in copies of the children's trials."""


def labels(data: Path) -> None:
    """Print which labels are exchanged in the sessions, how near the mended copies are, and which exchanges are found
    in copies.
    """
    from biodance.effects import Recorded
    from biodance.effects.labels_swapped import exchanges
    from biodance.lab.session.read import read_session
    from biodance.pipeline.accepted import with_right_labels
    from biodance.pipeline.session import examine

    folders = [*sorted((data / "biomechzoo").glob("HC*")), data / "pycgm", data / "adl_gait"]
    folders += [data / name for name in ("c3d_parser", "c3d_parser_QCMAS", "c3d_parser_Sydney", "gaitalytics")]
    print("| session | exchanged | RMS mm: as recorded -> mended |\n|---|---|---|")
    for folder in folders:
        session = read_session(folder)
        found = exchanges(Recorded(session))
        said = "; ".join(f"{name}: {', '.join(sorted('/'.join(p) for p in pairs))}" for name, pairs in found.items())
        moved = "-"
        if found:
            result = examine(session)
            right = with_right_labels(result, tell=lambda text: None)
            mended = right.result if right else result
            pairs = [(a, b) for a, b in zip(result.trials, mended.trials, strict=True) if a.fit and b.fit]
            moved = "; ".join(
                f"{a.trial.name}: {1e3 * a.fit.total_rms:.1f} -> {1e3 * b.fit.total_rms:.1f}" for a, b in pairs
            )
        print(f"| {folder.name} | {said or 'none'} | {moved} |", flush=True)
    _copies(data)


def _copies(data: Path) -> None:
    """Print by kind of exchange how many copies, exchanged in none to all of three files, give the right set."""
    from itertools import chain, combinations

    from biodance.effects import Recorded
    from biodance.effects.labels_swapped import exchanges, renamed
    from biodance.lab.session.read import read_session
    from biodance.records import Session

    print("\n| exchanged in copies | right sets |\n|---|---|")
    children = [read_session(folder) for folder in sorted((data / "biomechzoo").glob("HC*"))]
    for kind, pairs in EXCHANGES.items():
        right = total = 0
        for session in children:
            there = exchanges(Recorded(session))
            for wrong in chain.from_iterable(combinations(range(len(session.trials)), n) for n in range(4)):
                copies = [
                    renamed(one, dict.fromkeys(pairs, ((0, one.markers.time.size),)))
                    if k in wrong and one.markers
                    else one
                    for k, one in enumerate(session.trials)
                ]
                whole = all(one.markers and {*chain(*pairs)} <= {*one.markers.names} for one in session.trials)
                composed = any(not set(a).isdisjoint(b) and a != b for p in there.values() for a in p for b in pairs)
                if not whole or composed:
                    continue
                truth = {
                    one.name: frozenset(there.get(one.name, ())) ^ frozenset(pairs if k in wrong else ())
                    for k, one in enumerate(session.trials)
                }
                found = exchanges(Recorded(Session(session.subject, tuple(copies), session.folder)))
                said = {name: frozenset(p) for name, p in found.items()}
                total, right = total + 1, right + (said == {name: p for name, p in truth.items() if p})
        print(f"| {kind} | {right} of {total} |", flush=True)


LABORATORIES = read_toml(Path(__file__).with_name("marker_names.toml"))
"""What published sets and laboratories call a landmark, without side."""

SPELLINGS: dict[str, Callable[[str, str], str]] = {
    "RASI": lambda side, name: side[0].upper() + name,
    "R_ASI": lambda side, name: f"{side[0].upper()}_{name}",
    "r.ASI_study": lambda side, name: f"{side[0]}.{name}_study",
    "RightAsi": lambda side, name: side.capitalize() + name[0].upper() + name[1:].lower(),
    "asi_right": lambda side, name: f"{name.lower()}_{side}",
    "ASI_R": lambda side, name: f"{name}_{side[0].upper()}",
    "r_asi": lambda side, name: f"{side[0]}_{name.lower()}",
    "ASI R": lambda side, name: f"{name} {side[0].upper()}",
    "RASI.marker": lambda side, name: f"{side[0].upper()}{name}.marker",
}


def respelled(
    trial: Trial, worn: MarkerSet, names: dict[str, str], spell: Callable[[str, str], str]
) -> tuple[Markers, dict[str, str]]:
    """Return the landmarks of a static trial under another laboratory's labels, and label -> landmark."""
    truth, columns = {}, []
    assert trial.markers is not None
    for place, name in names.items():
        sides = ("",) if place in ("mid_psis", "c7", "t10", "jugular_notch", "xiphoid") else ("right", "left")
        for side in sides:
            found = landmark_path(trial.markers, worn, place, side)
            if found is not None and np.isfinite(found).any():
                truth[spell(side, name) if side else name] = f"{side}_{place}" if side else place
                columns.append(found)
    markers = Markers(tuple(truth), trial.markers.time, np.stack(columns, axis=1))
    return markers, truth


def landmark_path(markers: Markers, worn: MarkerSet, place: str, side: str) -> np.ndarray | None:
    """Return the path of a landmark; iliac spines and medial markers that this recording lacks are put beside what it
    has: 45 mm from the sacral marker, 100 mm (knee), 70 mm (ankle, elbow) inside the lateral one.
    """
    found = landmark(markers, worn, f"{side}_{place}" if side else place)
    spines = [landmark(markers, worn, f"{one}_asis") for one in ("right", "left")]
    inside = {
        "psis": ("mid_psis", -0.045),
        "knee_medial": ("knee_lateral", 0.1),
        "ankle_medial": ("ankle_lateral", 0.07),
        "elbow_medial": ("elbow_lateral", 0.07),
    }
    if found is not None or place not in inside or spines[0] is None or spines[1] is None:
        return found
    beside, width = inside[place]
    base = landmark(markers, worn, beside if beside == "mid_psis" else f"{side}_{beside}")
    right = (spines[0] - spines[1]) / np.linalg.norm(spines[0] - spines[1], axis=1, keepdims=True)
    return None if base is None else base - (1.0 if side == "right" else -1.0) * width * right


def names(data: Path) -> None:
    """Print the share of landmarks that the guess gets right, by laboratory, and every error."""
    statics = [
        *sorted(data.glob("biomechzoo/*/*01.c3d")),
        data / "pycgm/Static_trial.c3d",
        data / "adl_gait/2014001_ST.c3d",
    ]
    read = [read_trial(file) for file in statics]
    errors: dict[tuple[str, str, str], int] = {}
    total = np.zeros(4, dtype=int)
    for laboratory, spelled in LABORATORIES.items():
        count = np.zeros(4, dtype=int)
        for trial in read:
            worn = read_marker_set(trial.marker_set)
            for rule, spell in SPELLINGS.items():
                markers, truth = respelled(trial, worn, spelled, spell)
                guess = guess_set(markers)
                if not guess.name:
                    count += (0, 0, len(truth), 1)
                    errors[laboratory, rule, f"{trial.name}: refused: {guess.doubts[0]}"] = 1
                    continue
                right = sum(guess.map.get(label) == place for label, place in truth.items())
                wrong = [label for label, place in truth.items() if guess.map.get(label, place) != place]
                for label in wrong:
                    key = laboratory, rule, f"{label}: {guess.map[label]} for {truth[label]}"
                    errors[key] = errors.get(key, 0) + 1
                count += (right, len(wrong), len(truth) - right - len(wrong), 0)
        total += count
        right, wrong = 100 * count[:2] / count[:3].sum()
        print(f"| {laboratory} | {right:.1f} | {wrong:.2f} | {count[3]} |")
    print(f"| all | {100 * total[0] / total[:3].sum():.1f} | {100 * total[1] / total[:3].sum():.2f} | {total[3]} |")
    for key, times in sorted(errors.items(), key=lambda item: -item[1])[:25]:
        print("   ", times, *key)


if __name__ == "__main__":
    {"sessions": sessions, "names": names, "labels": labels}[sys.argv[1]](Path(os.environ["BIODANCE_DATA"]))
