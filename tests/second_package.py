"""A tiny second package with one member of every family, as pip leaves it in a folder of installed packages."""

import re
from pathlib import Path

from biodance.lab.markers.sets import FAMILY as MARKER_SETS
from biodance.lab.markers.sets import read_marker_set

RENAMED = {label: f"X{i:02d}" for i, label in enumerate(read_marker_set("plug_in_gait").labels)}
ENTRY_POINTS = """[biodance.effects]
cable = tiny_lab.cable:Cable
[biodance.readers]
tiny = tiny_lab.tiny_format
[biodance.segment_tables]
tiny_study = tiny_lab.files:TABLE
[biodance.marker_sets]
tiny_set = tiny_lab.files:MARKERS
[biodance.exports]
tiny = tiny_lab.tiny_export
"""
LIMIT_POINT = "[biodance.limits]\nlow_hands = tiny_lab.low_hands:LowHands\n"
CABLE = '''
"""A cable pulls sideways."""
import numpy as np
from biodance.effects import Case, Effect, Parameter


class Cable(Effect):
    """A pull (N) to the left, one metre over the lab's origin, 1.3 times a second."""

    name = "cable"
    parameters = (Parameter("pull", "N", 5.0, "a spring balance"),)
    advice = "Take the cable off the person."

    def columns(self, case: Case):
        force = np.sin(2 * np.pi * 1.3 * case.motion.time)
        zero = np.zeros_like(force)
        return np.stack([zero, force, zero, -force, zero, zero], axis=1)[:, :, None]
'''
FORMAT = '''
"""TINY: one line of labels, then time and coordinates in m, z up."""
from pathlib import Path

import numpy as np
from biodance.errors import FileRefused
from biodance.lab.markers.sets import recognise
from biodance.records import Markers, Source, Trial

NAME, EXTENSIONS, PREFERENCE = "TINY", (".tiny",), 50


def sniff(head):
    return head.startswith(b"TINY ")


def read(path: Path, *, role, subject=None):
    first, *rows = path.read_text().splitlines()
    labels = tuple(first.split()[1:])
    table = np.array([[float(cell) for cell in row.split()] for row in rows])
    if table.shape[1] != 1 + 3 * len(labels):
        raise FileRefused(f"{path}: {table.shape[1]} columns for {len(labels)} labels. Export it again.")
    found = recognise(labels)
    markers = Markers(labels, table[:, 0], table[:, 1:].reshape(len(table), -1, 3))
    source = Source(path, "", "TINY", rate=markers.rate)
    return Trial(path.stem, role, markers, (), source, marker_set=found.name if found else "")
'''
EXPORT = '''
"""One line a segment: its name and its mass."""
FORMAT, SUFFIX = "tiny", ".txt"


def text(body, source):
    return "".join(f"{name} {mass:.3f}\\n" for name, mass in zip(body.segments, body.sip.mass, strict=True))
'''
LIMIT = '''
"""No hand comes higher than a shelf."""
from dataclasses import dataclass

import numpy as np
from biodance.dance.limits import Limit, Margins, Remaining


@dataclass(frozen=True)
class LowHands(Limit):
    """``most`` rad/s of any joint."""

    most: float = 50.0
    name, unit, scale = "low_hands", "rad/s", 0.5

    def margins(self, state):
        rate = state.v[:, 6:]
        slope = -np.sign(rate)[:, :, None] * np.eye(state.chain.size)[6:]
        return Margins(self.most - np.abs(rate), np.stack([0 * slope, slope]))

    def check(self, motion):
        return Remaining(self.most - np.abs(motion.motion.v[:, 6:]), motion.joints)
'''
FILES = """
from pathlib import Path

TABLE = Path(__file__).parent / "tiny_study.csv"
MARKERS = Path(__file__).parent / "tiny_set.toml"
"""
TABLE = "segment,sex,quantity,axis,value,unit\nthigh,F,mass,,8,kg\nthigh,M,mass,,9,kg\nshank,FM,com,y,-0.4,length\n"


def renamed_set(labels: dict[str, str]) -> str:
    """Return the text of the plug-in gait set under other labels."""
    text = MARKER_SETS.shipped()["plug_in_gait"].read_text()
    text = re.sub(r"^\[aliases\].*?(?=^\[)", "", text, flags=re.MULTILINE | re.DOTALL)
    for label, own in labels.items():
        text = re.sub(rf"\b{label}\b", own, text)
    return text


def install(place: Path, *, points: str = ENTRY_POINTS) -> Path:
    """Write the package and what pip says of it into ``place``, a folder of installed packages; return it."""
    package, info = place / "tiny_lab", place / "tiny_lab-0.1.dist-info"
    package.mkdir(parents=True)
    info.mkdir()
    modules = {
        "__init__": "",
        "cable": CABLE,
        "tiny_format": FORMAT,
        "tiny_export": EXPORT,
        "low_hands": LIMIT,
        "files": FILES,
    }
    for name, code in modules.items():
        (package / f"{name}.py").write_text(code.lstrip())
    (package / "tiny_study.csv").write_text(TABLE)
    (package / "tiny_study.toml").write_text('title = "Two thighs"\nsource = "a test"\n')
    (package / "tiny_set.toml").write_text(renamed_set(RENAMED))
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: tiny-lab\nVersion: 0.1\n")
    (info / "entry_points.txt").write_text(points)
    return place
