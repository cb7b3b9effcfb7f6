"""What the subject is asked to do: postures, steps and trials, read from TOML and checked."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from biodance.errors import BiodanceError, UnknownName, refuse_unknown
from biodance.library import locate, read_toml
from biodance.records import ROLES, Array, Role


@dataclass(frozen=True)
class Gait:
    """A way to walk or run on a treadmill.

    ``speed`` m/s of the belt; ``stride`` s; ``stance`` share of the stride in which a foot is on the belt (below 0.5:
    running, with flight); ``width`` m between the ankles; ``strike``, ``push`` rad: pitch of the foot, toes up, when it
    lands, heel up when it leaves; ``flat`` shares of stance between which it lies flat; ``clearance`` m by which the
    ankle is lifted in swing; ``dip`` of the vertical force in mid stance (0 = one peak); ``arm``, ``elbow`` rad: swing
    of the upper arms and mean flexion of the elbows; ``lean`` rad of the trunk; ``knee`` rad, their least
    flexion.
    """

    name: str
    speed: float
    stride: float
    stance: float
    width: float
    strike: float
    push: float
    flat: tuple[float, float]
    clearance: float
    dip: float
    arm: float
    elbow: float
    lean: float
    knee: float

    @property
    def contact(self) -> float:
        """Seconds of one stance."""
        return self.stance * self.stride

    @property
    def flight(self) -> float:
        """Seconds of one flight; 0 in walking."""
        return max(0.0, (0.5 - self.stance) * self.stride)

    def since_strike(self, time: Array, side: str) -> Array:
        """Return the seconds (T,) since a foot last landed; the right one lands at 0."""
        return np.mod(time - (0.0 if side == "right" else 0.5 * self.stride), self.stride)


GAITS = {
    "walk": Gait("walk", 0.9, 1.2, 0.62, 0.17, 0.2, 0.5, (0.24, 0.5), 0.03, 0.18, 0.4, 0.35, 0.03, 0.07),
    "run": Gait("run", 2.0, 0.7, 0.38, 0.09, 0.05, 0.5, (0.35, 0.5), 0.06, 0.0, 0.6, 1.4, 0.08, 0.15),
}
"""Ways to go, by the names that a protocol uses. Stance 62 and 38 % of the stride: Novacheck 1998,
doi:10.1016/S0966-6362(97)00038-6; all else assumed so that people of 1.35 to 1.95 m settle into even strides.
"""


FIELDS: dict[str, tuple[float, ...]] = {
    "pelvis": (0.0, 0.0, 0.0),
    "trunk": (0.0, 0.0, 0.0),
    "head": (0.0, 0.0, 0.0),
    "right_arm": (0.0, -14.0, 10.0, 15.0),
    "left_arm": (0.0, -14.0, 10.0, 15.0),
    "right_leg": (0.0, 0.0, 0.0, 0.0, 0.0),
    "left_leg": (0.0, 0.0, 0.0, 0.0, 0.0),
    "depth": (0.0,),
    "lean": (0.0, 0.0),
    "shift": (0.5,),
}
"""Every field of a posture with its value in "stand"."""


@dataclass(frozen=True)
class ProtocolPosture:
    """One posture: ``values`` by field (degrees; depth as a fraction, lean in m, shift as a share); ``raised`` feet."""

    name: str
    values: dict[str, tuple[float, ...]]
    raised: frozenset[str] = frozenset()


@dataclass(frozen=True)
class ProtocolStep:
    """Go to a posture in ``move`` s and hold it ``hold`` s, or go there and back ``cycles`` times in ``period`` s."""

    to: ProtocolPosture
    move: float = 1.0
    hold: float = 0.5
    cycles: int = 0
    period: float = 1.0

    @property
    def duration(self) -> float:
        """Seconds of the whole step; cycles start up over one period and end over another."""
        return (self.cycles + 1) * self.period + self.hold if self.cycles else self.move + self.hold


@dataclass(frozen=True)
class TrialPlan:
    """One trial of a protocol: ``lead`` seconds of standing before and after the ``steps``; or ``gait`` ("walk", "run")
    on a belt of ``speed`` m/s (0: the gait's own) for a person of 1.75 m, others as the root of stature; for twice the
    ``lead``.
    """

    name: str
    role: Role
    stance: str
    steps: tuple[ProtocolStep, ...]
    lead: float = 1.0
    gait: str = ""
    speed: float = 0.0

    @property
    def duration(self) -> float:
        """Planned length of the recording, s."""
        return 2 * self.lead + sum(step.duration for step in self.steps)


@dataclass(frozen=True)
class Protocol:
    """A named sequence of trials; ``belts`` of the treadmill, 0 without one."""

    name: str
    trials: tuple[TrialPlan, ...]
    belts: int = 0


STAND = ProtocolPosture("stand", dict(FIELDS))
"""Upright, knees nearly straight, arms slightly away from the body."""


STEP_KEYS = ("to", "move", "hold", "cycles", "period")


def read_protocol(name_or_path: str | Path) -> Protocol:
    """Return a shipped protocol by name, or one of the user's by the path of its TOML file.

    Raises
    ------
    UnknownName
        No shipped protocol has this name and no such file exists.
    BiodanceError
        The file contradicts the format; the message names the file, the place, the value and what would be legal.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml":
        path = locate("protocols", str(name_or_path))
    raw = read_toml(path)
    postures = {"stand": STAND}
    for name, given in _table(path, raw, "postures").items():
        postures[name] = _posture(path, name, given, postures)
    trials = raw.get("trials", [])
    if not isinstance(trials, list) or not trials:
        raise BiodanceError(f"{path}: has no [[trials]]. Describe at least one trial.")
    plans = tuple(_trial(path, number, given, postures) for number, given in enumerate(trials, start=1))
    names = [plan.name for plan in plans]
    if len(set(names)) < len(names):
        raise BiodanceError(f"{path}: trial names occur twice ({', '.join(names)}). Give every trial its own name.")
    belts = raw.get("belts", 0)
    if belts not in (0, 1, 2) or (not belts and any(plan.gait for plan in plans)):
        raise BiodanceError(f"{path}: belts = {belts!r}; legal are 1 and 2 (split-belt), and 0 without any gait.")
    return Protocol(str(raw.get("name", path.stem)), plans, belts)


def _table(path: Path, raw: dict[str, Any], key: str) -> dict[str, Any]:
    value = raw.get(key, {})
    if not isinstance(value, dict):
        raise BiodanceError(f"{path}: [{key}] must be a table, found {type(value).__name__}.")
    return value


def _numbers(path: Path, where: str, value: object, count: int) -> tuple[float, ...]:
    listed = value if isinstance(value, list) else [value]
    good = all(isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x) for x in listed)
    if not good or len(listed) != count:
        raise BiodanceError(f"{path}: {where} = {value!r}; expected {count} finite number{'s' if count > 1 else ''}.")
    return tuple(float(cast(float, x)) for x in listed)


def _posture(path: Path, name: str, given: Any, known: dict[str, ProtocolPosture]) -> ProtocolPosture:
    if not isinstance(given, dict):
        raise BiodanceError(f"{path}: posture {name!r} must be a table, found {given!r}.")
    base = given.get("based_on", "stand")
    refuse_unknown(f"posture written before {name!r} in {path}", str(base), known)
    values, raised = dict(known[base].values), set(known[base].raised)
    for key, value in given.items():
        if key == "based_on":
            continue
        if key not in FIELDS:
            raise UnknownName.of(f"field of posture {name!r} in {path}", key, (*FIELDS, "based_on"))
        values[key] = _numbers(path, f"postures.{name}.{key}", value, len(FIELDS[key]))
        raised |= {key.removesuffix("_leg")} if key.endswith("_leg") else set()
    if len(raised) == 2:
        raise BiodanceError(f"{path}: posture {name!r} raises both feet; one must stay on the plate.")
    if raised and "shift" not in given:
        values["shift"] = (0.0,) if "right" in raised else (1.0,)
    if not 0 <= values["shift"][0] <= 1 or not 0 <= values["depth"][0] <= 0.6:
        raise BiodanceError(
            f"{path}: posture {name!r}: shift must be in 0..1 and depth in 0..0.6, found {values['shift']}, "
            f"{values['depth']}."
        )
    return ProtocolPosture(name, values, frozenset(raised))


def _trial(path: Path, number: int, given: Any, postures: dict[str, ProtocolPosture]) -> TrialPlan:
    if not isinstance(given, dict) or "name" not in given:
        raise BiodanceError(f"{path}: trial number {number} needs a name.")
    name, role, stance = str(given["name"]), str(given.get("role", "fit")), str(given.get("stance", "parallel"))
    if role not in ROLES:
        raise UnknownName.of(f"role of trial {name!r} in {path}", role, ROLES)
    refuse_unknown(f"stance of trial {name!r} in {path}", stance, ("parallel", "right_forward"))
    lead = _numbers(path, f"{name}.lead", given.get("lead", 1.0), 1)[0]
    if "gait" in given:
        refuse_unknown(f"gait of trial {name!r} in {path}", str(given["gait"]), GAITS)
        seconds = _numbers(path, f"{name}.seconds", given.get("seconds", 10.0), 1)[0]
        speed = _numbers(path, f"{name}.speed", given.get("speed", GAITS[given["gait"]].speed), 1)[0]
        if not 2 <= seconds <= 600 or not 0.3 <= speed <= 5:
            said = f"{seconds} s at {speed} m/s; legal are 2 to 600 s, 0.3 to 5 m/s."
            raise BiodanceError(f"{path}: trial {name!r}: {said}")
        return TrialPlan(name, role, "parallel", (), seconds / 2, str(given["gait"]), speed)
    steps = tuple(_step(path, name, step, postures) for step in given.get("steps", []))
    _check_feet(path, name, steps)
    if steps and (steps[-1].to.raised or not steps[-1].cycles) and steps[-1].to.name != "stand":
        steps = (*steps, ProtocolStep(STAND, move=1.3, hold=0.0))
    if lead < 0 or (not steps and lead == 0):
        raise BiodanceError(f"{path}: trial {name!r} lasts no time; give steps or a lead in seconds.")
    return TrialPlan(name, role, stance, steps, lead)


def _check_feet(path: Path, trial: str, steps: tuple[ProtocolStep, ...]) -> None:
    """Refuse steps in which a foot would have to rise while the other one is still up, or within a cycle."""
    up: frozenset[str] = frozenset()
    for number, step in enumerate(steps, start=1):
        if step.to.raised != up and (step.cycles or (up and step.to.raised)):
            raise BiodanceError(
                f"{path}: trial {trial!r}, step {number} to {step.to.name!r} changes which foot is up "
                f"{'within a cycle' if step.cycles else 'without putting the other one down'}. Put a step with both "
                f"feet down before it."
            )
        up = step.to.raised


def _step(path: Path, trial: str, given: Any, postures: dict[str, ProtocolPosture]) -> ProtocolStep:
    if not isinstance(given, dict) or given.get("to") not in postures:
        wanted = given.get("to", given) if isinstance(given, dict) else given
        raise UnknownName.of(f"posture of trial {trial!r} in {path}", str(wanted), tuple(postures))
    for key in given:
        refuse_unknown(f"key of a step of trial {trial!r} in {path}", key, STEP_KEYS)
    seconds = {k: _numbers(path, f"{trial}.{k}", given[k], 1)[0] for k in ("move", "hold", "period") if k in given}
    if any(value < 0.25 for key, value in seconds.items() if key != "hold") or seconds.get("hold", 0.0) < 0:
        raise BiodanceError(
            f"{path}: trial {trial!r}, step to {given['to']!r}: {seconds}; a person needs at least 0.25 s for a move "
            f"or a cycle."
        )
    cycles = given.get("cycles", 0)
    if not isinstance(cycles, int) or cycles < 0:
        raise BiodanceError(f"{path}: trial {trial!r}: cycles = {cycles!r}; expected a whole number >= 1.")
    return ProtocolStep(postures[given["to"]], cycles=cycles, **seconds)
