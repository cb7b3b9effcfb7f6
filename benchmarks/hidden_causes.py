"""What is hidden in which session: nulls, every cause at three sizes, pairs, discrete faults, effects that no file
describes.

``SINGLE`` gives every cause in words, with the size ``{a}`` near the limit that the diagnosis computes for this
protocol; sessions hide 0.45, 1 and 3 times that. Whether a session lies below or above its own limit is decided by the
limit of that very session.
"""

from dataclasses import dataclass

from hidden_sessions import Scenario

LEVELS = {"below": 0.45, "at": 1.0, "above": 3.0}
Name = tuple[str, str]


@dataclass(frozen=True)
class Cause:
    """One cause in words; ``limit`` the reference size; ``alike`` other names of the same thing, which count as the
    truth.
    """

    words: str
    limit: float
    alike: tuple[Name, ...] = ()

    def text(self, size: float) -> str:
        """Return the words with a size in place of ``{a}``, three quarters of it for ``{b}``."""
        return self.words.format(a=f"{size:.6g}", b=f"{0.75 * size:.6g}")

    @property
    def name(self) -> Name:
        """Effect and target."""
        effect, _, rest = self.words.partition(":")
        first = rest.split(",")[0]
        return effect, first.removeprefix("target=") if first.startswith("target=") else ""


SINGLE = (
    Cause("plate_offset:target=Fz,offset={a}", 7.5),
    Cause("plate_offset:target=Fx,offset={a}", 2.1),
    Cause("plate_offset:target=My,offset={a}", 1.8),
    Cause("plate_gain:target=Fz,gain={a}", 0.018),
    Cause("plate_gain:target=Fy,gain={a}", 0.0215),
    Cause("plate_gain:target=Mx,gain={a}", 0.023),
    Cause("plate_crosstalk:target=Fz->My,ratio={a}", 0.0037),
    Cause("plate_crosstalk:target=Fz->Fx,ratio={a}", 0.0046),
    Cause("plate_drift:target=Fz,drift={a}", 0.15),
    Cause("plate_drift:target=Mx,drift={a}", 0.42),
    Cause("plate_position:target=plate1:x,shift={a}", 0.0083),
    Cause("plate_position:target=plate1:y,shift={a}", 0.0079),
    Cause("plate_rotation:target=plate1:z,angle={a}", 0.0125),
    Cause("body_mass:error={a}", 1.6),
    Cause("time_delay:delay={a}", 0.0018),
    Cause("clock_drift:stretch={a}", 0.00085),
    Cause("lab_tilt:target=x,angle={a}", 0.0105),
    Cause("plate_hysteresis:target=Fz,width={a}", 0.255),
    Cause("added_mass:target=left_forearm_hand,mass={a}", 0.83),
    Cause("added_mass:target=right_upper_arm,mass={a}", 1.1),
    Cause("added_mass:target=right_shank,mass={a}", 1.17),
    Cause("added_mass:target=right_thigh,mass={a}", 1.63),
    Cause("added_mass:target=trunk_head,mass={a}", 1.72),
    Cause("external_contact:target=right_forearm_hand,force={a}", 1.1),
    Cause("external_contact:target=left_foot,force={a}", 2.0),
    Cause("body_weight_support:target=pelvis,force={a},stiffness={a}", 2.2),
    Cause("sloshing_load:target=trunk_head,mass={a},sloshing={b}", 2.0),
    Cause("wobbling_mass:target=trunk_head,mass={a}", 1.5),
    Cause("joint_centre:target=right_hip,shift={a};0;0", 0.027),
    Cause("joint_centre:target=right_shoulder,shift=0;0;{a}", 0.018),
    Cause("segment_length:target=right_thigh,error={a}", 0.0105, (("joint_centre", "right_knee"), ("segment_length",
    "right_shank"))),
    Cause("marker_misplaced:target=RKNE,shift={a};0;0", 0.02),
    Cause("marker_misplaced:target=LSHO,shift={a};0;0", 0.02),
    Cause("head_joint:angle={a}", 0.076),
    Cause("trunk_joint:angle={a}", 0.0585),
    Cause("shoulder_girdle:angle={a}", 0.08),
)  # fmt: skip
FILTERS = {"below": 8.5, "at": 7.5, "above": 4.0}
"""Hz; a lower cut-off is a larger fault."""
MEASURED = {"segment_length": "joint_centre"}
"""Cause whose limit counts instead: the static trial has measured the whole leg, so a longer thigh is a knee that
lies elsewhere.
"""
SAME = {"dropped_frames": (("frame_rate", ""),)}
"""Names of the check that finds a fault which has no file of its own."""
PAIRS = (
    ("time_delay:delay=0.02", "added_mass:target=left_forearm_hand,mass=2.4"),
    ("plate_gain:target=Fz,gain=0.06", "plate_position:target=plate1:x,shift=0.025"),
    ("plate_offset:target=Fx,offset=9", "plate_rotation:target=plate1:z,angle=0.05"),
    ("plate_drift:target=Mx,drift=6", "plate_crosstalk:target=Fz->Fx,ratio=0.015"),
    ("clock_drift:stretch=0.02", "plate_offset:target=My,offset=9"),
    ("time_delay:delay=0.015", "plate_position:target=plate1:y,shift=0.025"),
    ("plate_rotation:target=plate1:z,angle=0.04", "added_mass:target=right_shank,mass=4"),
    ("plate_gain:target=Fz,gain=0.06", "plate_drift:target=Fy,drift=6"),
)
UNKNOWN = {
    "plate_creep:target=Fz,ratio={}": (0.01, 0.03),
    "plate_bending:size={}": (0.02, 0.06),
    "loose_connection:target=Fz,gain={}": (0.05, 0.15),
    "trigger_jitter:jitter={}": (0.015, 0.04),
    "object_on_plate:weight={}": (15, 50),
    "saturating:target=Fz,ratio={}": (0.05, 0.15),
    "swaying_cameras:sway={}": (0.002, 0.006),
    "slack_harness:stiffness={}": (5000, 20000),
    "table_edge:force={}": (10, 30),
    "spinning_wheel:momentum={}": (10, 40),
}
DISCRETE = (
    "unit_error:factor=4.448", "axis_error:target=Fx", "axis_error:target=My", "clipping:target=Fz,limit=700",
    "mains_hum:target=Fz,amplitude=15",
    "labels_swapped:target=LKNE/RKNE", "labels_swapped:target=RWRA/RWRB", "frame_rate:ratio=1.2",
    "dropped_frames:count=12",
)  # fmt: skip
ISSUE = (
    "time_delay:delay=0.02", "plate_gain:target=Fz,gain=0.04", "plate_rotation:target=plate1:z,angle=0.0698132",
    "plate_position:target=plate1:x,shift=0.02", "plate_offset:target=Fz,offset=20",
    "added_mass:target=left_forearm_hand,mass=2.4",
)  # fmt: skip
"""The faults whose gain the issue asks for."""


FIRST = {
    ("plate_offset", "Fz"), ("plate_gain", "Fz"), ("plate_position", "plate1:x"), ("time_delay", ""), ("lab_tilt", "x"),
    ("added_mass", "left_forearm_hand"), ("added_mass", "right_thigh"), ("external_contact", "right_forearm_hand"),
    ("joint_centre", "right_hip"), ("joint_centre", "right_shoulder"), ("segment_length", "right_thigh"),
    ("marker_misplaced", "RKNE"), ("head_joint", ""), ("trunk_joint", ""),
}  # fmt: skip
"""The causes that come first in a `sample`: of every kind."""


def person(subject: int) -> dict[str, int]:
    """Return subject and seed of the persons in whose sessions something is hidden: other bodies than the nulls'."""
    return {"subject": subject, "seed": 700 + subject}


def nulls(subjects: range = range(20), visits: range = range(6)) -> list[Scenario]:
    """Return sessions without fault; 20 persons, 6 visits each."""
    return [Scenario("null", i, 900 + i, v) for v in visits for i in subjects]


def singles(level: str, subjects: tuple[int, ...]) -> list[Scenario]:
    """Return every cause at one level."""
    out = []
    for i in subjects:
        texts = [cause.text(LEVELS[level] * cause.limit) for cause in SINGLE] + [
            f"filter_mismatch:cutoff={FILTERS[level]:g}"
        ]
        out += [Scenario("single", **person(i), hidden=(text,), level=level) for text in texts]
    return out


def others(subjects: tuple[int, ...]) -> list[Scenario]:
    """Return the faults of the issue, pairs, unknown effects at two sizes and discrete faults."""
    out = []
    for i in subjects:
        who = person(i)
        out += [Scenario("issue", **who, hidden=(text,), level="above") for text in ISSUE]
        out += [Scenario("pair", **who, hidden=pair) for pair in PAIRS]
        out += [
            Scenario("unknown", **who, hidden=(text.format(size),), level=level)
            for text, sizes in UNKNOWN.items()
            for level, size in zip(("small", "large"), sizes, strict=True)
        ]
        out += [Scenario("discrete", **who, hidden=(text,)) for text in DISCRETE]
    return out


def mixed(*parts: list[Scenario]) -> list[Scenario]:
    """Return all scenarios of the parts, dealt out evenly."""
    placed = [((k + 0.5) / len(part), n, one) for n, part in enumerate(parts) for k, one in enumerate(part)]
    return [one for _, _, one in sorted(placed, key=lambda place: place[:2])]


def everything() -> list[Scenario]:
    """Return the full set in waves, each a sample of the whole, so that a run that was stopped has seen of
    everything.
    """
    waves = [
        mixed(nulls(visits=range(1)), singles("above", (0,)), others((0,))),
        mixed(nulls(visits=range(1, 3)), singles("above", (1,)), singles("below", (0,)), others((1,))),
        mixed(
            nulls(visits=range(3, 5)), singles("above", (2,)), singles("below", (1,)), singles("at", (0,)), others((2,))
        ),
        mixed(
            nulls(visits=range(5, 6)), singles("above", (3,)), singles("below", (2,)), singles("at", (1,)), others((3,))
        ),
        mixed(singles("at", (2, 3)), singles("below", (3,))),
    ]
    return [scenario for wave in waves for scenario in wave]


def sample() -> list[Scenario]:
    """Return a fixed sample of the list, to put two versions of the code side by side: 24 sessions of 20 persons
    without fault, and every cause at three times its usual limit in two persons, the most different causes first.
    """
    faults = singles("above", (0, 1))
    first = [one for one in faults if Cause(one.hidden[0], 0.0).name in FIRST]
    nothing = [*nulls(visits=range(1)), *nulls(range(4), range(1, 2))]
    return [*mixed(nothing, first), *(one for one in faults if one not in first)]


def truth(scenario: Scenario) -> list[set[Name]]:
    """Return for every hidden cause the names that count as the truth."""
    table = {cause.name: cause for cause in SINGLE}
    out = []
    for text in scenario.hidden:
        name = Cause(text, 0.0).name
        out.append({name, *(table[name].alike if name in table else ()), *SAME.get(name[0], ())})
    return out
