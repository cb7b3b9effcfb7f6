"""Sessions of whom a verdict may say nothing false, each tracked once and kept (bench_honesty.py): real recordings,
people of a foreign virtual laboratory, laboratories of a family, and the own one, with and without a fault.
"""

import os
import random
import shutil
import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

from hidden_causes import SINGLE, nulls, singles, truth
from hidden_sessions import CACHE, examined
from kept_files import kept

from biodance.lab.session.read import read_session
from biodance.pipeline.results import SessionResult
from biodance.pipeline.session import examine
from biodance.virtual_lab.faults.causes import hide, parse_cause
from biodance.virtual_lab.movement.protocol import read_protocol
from biodance.virtual_lab.recording.family import draw_laboratory, draw_visitor
from biodance.virtual_lab.recording.laboratory import LabVisit
from biodance.virtual_lab.simulate import simulate_session

REAL = (
    *(f"biomechzoo/HC{number}A" for number in ("030", "031", "032", "038", "044", "050", "055")), "adl_gait", "pycgm",
    "c3d_parser_Sydney", "c3d_parser_QCMAS", "gaitalytics/test_small", "gaitalytics/treadmill_no_events", "c3d_parser",
)  # fmt: skip
TRULY = {
    "biomechzoo/HC030A": {"labels_swapped"},
    "biomechzoo/HC038A": {"labels_swapped"},
    "biomechzoo/HC050A": {"labels_swapped"},
    "biomechzoo/HC055A": {"labels_swapped"},
    "c3d_parser_QCMAS": {"time_delay"},
}
"""What is wrong in a real session: names that are not false."""
PEOPLE = (
    ("F", 1.68, 61), ("M", 1.81, 78), ("F", 1.59, 54), ("M", 1.74, 70), ("F", 1.75, 66), ("M", 1.90, 88),
    ("F", 1.63, 72), ("M", 1.69, 60),
)  # fmt: skip
ROOM = ("--noise", "0.6", "--camera", "0.3")
ROOMS = {
    "real rooms": (ROOM, 24), "as quiet as here": (("--noise", "0.22", "--camera", "1.5"), 12), "as it comes": ((), 12),
}  # fmt: skip
"""Noise of the foreign laboratory, and the people recorded with it: 401, 402, ..."""
NAMED = (
    "plate_offset:target=Fx", "plate_gain:target=Fz", "plate_crosstalk:target=Fz->My", "plate_drift:target=Mx",
    "plate_position:target=plate1:x", "plate_rotation:target=plate1:z", "time_delay",
    "added_mass:target=left_forearm_hand",
)  # fmt: skip
IN_FAMILY = (
    "plate_position:target=plate1:x,shift=0.02", "time_delay:delay=0.02", "plate_offset:target={}Fx,offset=15",
    "plate_rotation:target=plate1:z,angle=0.0698", "added_mass:target=left_forearm_hand,mass=2.4",
    "plate_gain:target={}Fz,gain=0.05",
)  # fmt: skip
"""Hidden in laboratories 1, 2, ... of the family; ``{}`` is the plate where there are several."""


def real_session(name: str) -> SessionResult:
    """Return a real session, tracked once."""
    place = Path(os.environ["BIODANCE_DATA"]) / name

    def folder() -> Path:
        if place.is_dir():
            return place
        alone = CACHE / "real" / name
        alone.mkdir(parents=True, exist_ok=True)
        shutil.copy(place.with_suffix(".c3d"), alone)
        return alone

    return _kept(f"real-{name.replace('/', '-')}", folder)


def foreign_session(seed: int, room: str) -> SessionResult:
    """Return a clean session of the foreign laboratory with the noise of a room, tracked once."""
    return _kept(f"foreign-{room.replace(' ', '_')}-{seed}", lambda: foreign_folder(seed, room))


def foreign_folder(seed: int, room: str) -> Path:
    """Return the folder of a clean session of the foreign laboratory, written once."""
    folder = CACHE / "foreign" / room.replace(" ", "_") / f"P{seed}"
    if not folder.is_dir():
        folder.parent.mkdir(parents=True, exist_ok=True)
        script = Path(os.environ["BIODANCE_FOREIGN_LAB"]) / "foreign_lab.py"
        told = [*person_of(seed), *ROOMS[room][0], "--out", str(folder)]
        subprocess.run([sys.executable, str(script), *told], check=True, stdout=subprocess.DEVNULL)
    return folder


def family_session(number: int, hidden: str = "") -> SessionResult:
    """Return a session of one laboratory of the family, of a visitor of its own, with or without a cause; tracked
    once.
    """
    name = f"{number}-{hidden.replace(':', '_').replace(',', '_').replace('>', '') or 'clean'}"

    def written() -> Path:
        folder = CACHE / "family" / name
        if not folder.is_dir():
            laboratory = draw_laboratory(number)
            who, plan = draw_visitor(laboratory, number), read_protocol("diagnosis")
            plan = replace(plan, trials=tuple(one for one in plan.trials if one.role != "validate"))
            causes = (parse_cause(hidden),) if hidden else ()
            visit, loads = hide(causes, who, plan, seed=number, visit=LabVisit(laboratory=laboratory))
            simulate_session(who, plan, folder, seed=number, visit=visit, loads=loads)
        return folder

    return _kept(f"family-{name}", written)


def person_of(seed: int) -> list[str]:
    """Return seed, sex, stature and mass of a person of the foreign laboratory as it takes them."""
    draw, sex = random.Random(seed), "FM"[seed % 2]
    height = round(draw.uniform(1.52, 1.75) if sex == "F" else draw.uniform(1.64, 1.95), 2)
    mass = round(draw.uniform(19.5, 28.5) * height * height, 1)
    return ["--seed", str(seed), "--sex", sex, "--height", str(height), "--mass", str(mass)]


def _kept(key: str, folder) -> SessionResult:  # type: ignore[no-untyped-def]
    return kept(CACHE / "honesty" / f"{key}.pickle", lambda: examine(read_session(folder())))


def jobs(foreign: int, own: int, family: int) -> list[tuple[str, str, object, set[str], str]]:
    """Return key, column, how to get the session, true names and hidden cause of every session."""
    out: list[tuple[str, str, object, set[str], str]] = [
        (f"real {name}", "real", lambda name=name: real_session(name), TRULY.get(name, set()), "") for name in REAL
    ]
    for room, (_, people) in ROOMS.items():
        for seed in range(401, 401 + min(foreign, people)):
            get = partial(foreign_session, seed, room)
            out.append((f"foreign, {room}, P{seed}", f"foreign, {room}", get, set(), ""))
    for number in range(1, 1 + family):
        out.append((f"family {number}", "family", partial(family_session, number), set(), ""))
        text = IN_FAMILY[(number - 1) % len(IN_FAMILY)].format("plate1:" if draw_laboratory(number).plates > 1 else "")
        effect, _, rest = text.partition(":target=")
        true = {f"{effect.partition(':')[0]} {rest.partition(',')[0]}".strip()}
        get = partial(family_session, number, text)
        out.append((f"family {number}, {text}", "family, one fault", get, true, text))
    for one in nulls()[:own]:
        out.append((f"own {one.key}", "own", lambda one=one: examined(one), set(), ""))
    causes = {one.words.partition(",")[0]: one for one in SINGLE}
    texts = [next(c for words, c in causes.items() if words.startswith(name)).text(0) for name in NAMED]
    chosen = {text.partition(",")[0] for text in texts} | {"time_delay"}
    for one in singles("above", (0,)):
        if any(one.hidden[0].startswith(name) for name in chosen):
            true = {" ".join(name).strip() for same in truth(one) for name in same}
            out.append((f"own {one.hidden[0]}", "own", lambda one=one: examined(one), true, one.hidden[0]))
    return out
