"""The frozen records that every stage of biodance speaks.

Conventions, everywhere behind the reader: SI units (m, kg, s, N, N·m, rad); lab frame with z up; wrenches are the ground's
action ON the subject, about the lab origin, force first; time is the first axis; NaN means "not seen". Arrays are copied,
checked for shape at birth and read-only afterwards; change a record with ``dataclasses.replace``.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from biodance.errors import BiodanceError, SessionRefused, TrialRefused, UnknownName
from biodance.settings import COP_FORCE, USUAL, Settings

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Role = Literal["static", "fit", "validate", "check", "skip"]
ROLES: tuple[Role, ...] = ("static", "fit", "validate", "check", "skip")
CHANNELS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


def frozen_array(value: ArrayLike, shape: tuple[int | None, ...], what: str) -> Array:
    """Return a read-only float copy of ``value`` after checking its shape (``None`` = any length).

    Raises
    ------
    BiodanceError
        The shape is wrong; the message names ``what``, the shape found and the shape expected.
    """
    array = np.array(value, dtype=float)
    fits = array.ndim == len(shape) and all(n is None or n == m for n, m in zip(shape, array.shape, strict=True))
    if not fits:
        expected = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ")"
        raise BiodanceError(f"{what} has shape {array.shape}, expected {expected}.")
    array.setflags(write=False)
    return array


def _set(record: object, **values: object) -> None:
    """Assign fields of a frozen record during its own ``__post_init__``."""
    for name, value in values.items():
        object.__setattr__(record, name, value)


def _check_time(time: ArrayLike, what: str) -> Array:
    time = frozen_array(time, (None,), f"{what}.time")
    if time.size > 1 and not np.all(np.diff(time) > 0):
        frame = int(np.argmin(np.diff(time) > 0))
        raise BiodanceError(f"{what}.time does not increase at sample {frame + 1} ({time[frame]:g} s, {time[frame + 1]:g} s).")
    return time


def _rate(time: Array) -> float:
    """Return the mean sampling rate in Hz; NaN for fewer than two samples."""
    return float((time.size - 1) / (time[-1] - time[0])) if time.size > 1 else float("nan")


@dataclass(frozen=True, eq=False)
class Markers:
    """Marker trajectories: ``names`` (K), ``time`` (T,) s, ``xyz`` (T, K, 3) m in the lab frame, NaN = not seen."""

    names: tuple[str, ...]
    time: Array
    xyz: Array

    def __post_init__(self) -> None:
        names = tuple(self.names)
        time = _check_time(self.time, "Markers")
        _set(self, names=names, time=time, xyz=frozen_array(self.xyz, (time.size, len(names), 3), "Markers.xyz"))
        if len(set(names)) != len(names):
            twice = sorted({n for n in names if names.count(n) > 1})
            raise BiodanceError(f"Marker names occur twice: {', '.join(twice)}.")

    @property
    def rate(self) -> float:
        """Sampling rate, Hz."""
        return _rate(self.time)

    @property
    def seen(self) -> NDArray[np.bool_]:
        """(T, K) True where a marker was seen."""
        return np.logical_not(np.isnan(self.xyz).any(axis=2))

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def __getitem__(self, name: str) -> Array:
        """Return the trajectory (T, 3) m of one marker by its label."""
        if name not in self.names:
            raise UnknownName.of("marker of this trial", name, self.names)
        return self.xyz[:, self.names.index(name)]

    def select(self, names: Iterable[str]) -> "Markers":
        """Return only the named markers, in the order given; UnknownName lists the legal ones."""
        names = tuple(names)
        return Markers(names, self.time, np.stack([self[n] for n in names], axis=1) if names else np.empty((self.time.size, 0, 3)))


@dataclass(frozen=True, eq=False)
class Wrench:
    """Ground's wrench ON the subject about the lab origin: ``time`` (T,) s, ``value`` (T, 6) N, N·m (force, moment)."""

    time: Array
    value: Array

    def __post_init__(self) -> None:
        time = _check_time(self.time, "Wrench")
        _set(self, time=time, value=frozen_array(self.value, (time.size, 6), "Wrench.value"))

    @property
    def rate(self) -> float:
        """Sampling rate, Hz."""
        return _rate(self.time)

    @property
    def force(self) -> Array:
        """(T, 3) N, lab frame."""
        return self.value[:, :3]

    @property
    def moment(self) -> Array:
        """(T, 3) N·m about the lab origin, lab frame."""
        return self.value[:, 3:]

    def cop(self, *, height: float = 0.0, threshold: float = COP_FORCE) -> Array:
        """Centre of pressure (T, 3) m on the horizontal plane ``z = height``; NaN where |Fz| < ``threshold`` N."""
        (fx, fy, fz), (mx, my, _) = self.force.T, self.moment.T
        loaded = np.abs(fz) >= threshold
        safe = np.where(loaded, fz, 1.0)
        x, y = (fx * height - my) / safe, (fy * height + mx) / safe
        return np.where(loaded[:, None], np.stack([x, y, np.full_like(x, height)], axis=1), np.nan)


@dataclass(frozen=True, eq=False)
class Plate:
    """One force plate of one trial.

    ``name`` as in the lab's numbering (``plate1``); ``type`` C3D TYPE, 0 for native files; ``corners`` (4, 3) m lab frame, in file
    order; ``wrench`` ground-on-subject about the LAB origin, at analog rate as read, at marker times once prepared;
    ``decisions`` plain sentences: sign, zero, units, corner order - what was decided and why; ``zero`` (3,) N the force that the EMPTY
    plate read and that was subtracted, lab frame, as if it acted on the subject.
    """

    name: str
    type: int
    corners: Array
    wrench: Wrench
    decisions: tuple[str, ...] = ()
    zero: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        corners, zero = frozen_array(self.corners, (4, 3), f"{self.name}.corners"), frozen_array(self.zero, (3,), f"{self.name}.zero")
        _set(self, corners=corners, zero=zero, decisions=tuple(self.decisions))

    @property
    def centre(self) -> Array:
        """(3,) m, mean of the corners."""
        return self.corners.mean(axis=0)

    @property
    def height(self) -> float:
        """Height of the plate's centre over the lab origin, m."""
        return float(self.corners[:, 2].mean())


@dataclass(frozen=True, eq=False)
class Motion:
    """Generalised motion of a Body: ``time`` (T,) s; ``q`` (T, nq), ``v``, ``a`` (T, nv) in Pinocchio's order.

    A free-flyer root comes first: q = [x y z, quaternion x y z w, joint angles]; v and a of the root are linear then angular,
    expressed in the root's own frame. ``residual`` (T, K) m is the distance of every marker to the model, NaN = not seen;
    ``marker_names`` (K). ``determined`` (T,) is False where a frame's own markers did not give its posture (default: all True);
    ``notes`` say in plain sentences how the motion was found.
    """

    time: Array
    q: Array
    v: Array
    a: Array
    residual: Array = field(default_factory=lambda: np.empty((0, 0)))
    marker_names: tuple[str, ...] = ()
    determined: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, dtype=bool))
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        time = _check_time(self.time, "Motion")
        frames = time.size
        v = frozen_array(self.v, (frames, None), "Motion.v")
        residual = self.residual if np.size(self.residual) else np.empty((frames, 0))
        determined = np.array(self.determined, dtype=bool) if np.size(self.determined) else np.ones(frames, dtype=bool)
        if determined.shape != (frames,):
            raise BiodanceError(f"Motion.determined has shape {determined.shape}, expected ({frames},).")
        determined.setflags(write=False)
        _set(
            self,
            time=time,
            determined=determined,
            notes=tuple(self.notes),
            q=frozen_array(self.q, (frames, None), "Motion.q"),
            v=v,
            a=frozen_array(self.a, (frames, v.shape[1]), "Motion.a"),
            residual=frozen_array(residual, (frames, len(self.marker_names)), "Motion.residual"),
            marker_names=tuple(self.marker_names),
        )

    @property
    def rate(self) -> float:
        """Sampling rate, Hz."""
        return _rate(self.time)


@dataclass(frozen=True)
class Source:
    """Where a trial came from: path, sha256 of its bytes, format, rates in Hz (NaN = none), first frame number in the file."""

    path: Path
    sha256: str
    format: str
    rate: float = float("nan")
    analog_rate: float = float("nan")
    first_frame: int = 1


@dataclass(frozen=True, eq=False)
class Trial:
    """One recording: markers and/or force plates, with its role and its history.

    ``history`` lists in plain sentences what was done with which parameters: signs, zeros, units, gaps, filters.
    ``warnings`` lists what a person should look at. ``measurements`` are the subject's measures stored in the file (m, kg; names as
    in the PROCESSING group, for example ``Bodymass``, ``LLegLength``). ``marker_set`` is the name of the recognised set or "".
    """

    name: str
    role: Role
    markers: Markers | None
    plates: tuple[Plate, ...]
    source: Source
    marker_set: str = ""
    measurements: Mapping[str, float] = field(default_factory=dict)
    history: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    settings: Settings = USUAL

    def __post_init__(self) -> None:
        if self.role not in ROLES:
            raise UnknownName.of("trial role", self.role, ROLES)
        _set(
            self,
            plates=tuple(self.plates),
            measurements=MappingProxyType(dict(self.measurements)),
            history=tuple(self.history),
            warnings=tuple(self.warnings),
        )

    @property
    def wrench(self) -> Wrench:
        """Total wrench of all plates about the lab origin.

        Raises
        ------
        TrialRefused
            The trial has no force plate, or its plates do not share one time base.
        """
        if not self.plates:
            raise TrialRefused(f"Trial {self.name}: no force plate was recorded, so there is no wrench. Record with the plates on.")
        time = self.plates[0].wrench.time
        if any(not np.array_equal(p.wrench.time, time) for p in self.plates):
            raise TrialRefused(f"Trial {self.name}: the plates have different time bases; prepare the trial first.")
        return Wrench(time, np.sum([p.wrench.value for p in self.plates], axis=0))


@dataclass(frozen=True)
class Subject:
    """The person: body mass kg, stature m, sex "F" or "M", age years; ``measurements`` in m and kg by name.

    NaN = not known: always possible for the age; for mass and stature where nobody declared them and no recording tells them (a note in the
    session says so). A step that needs them calls `require` first. ``guessed`` names what nobody declared ("mass", "stature", "sex").
    """

    mass: float
    stature: float
    sex: Literal["F", "M"]
    age: float = float("nan")
    name: str = ""
    measurements: Mapping[str, float] = field(default_factory=dict)
    guessed: tuple[str, ...] = ()

    def require(self, *quantities: Literal["mass", "stature", "age"]) -> None:
        """Raise SessionRefused if one of the named quantities is not known; the message says which key of session.toml helps."""
        keys = {"mass": "mass_kg", "stature": "height_m", "age": "age"}
        unknown = [quantity for quantity in quantities if np.isnan(getattr(self, quantity))]
        if unknown:
            verb, wanted = "is" if len(unknown) == 1 else "are", " and ".join(keys[quantity] for quantity in unknown)
            raise SessionRefused(f"{self.name or 'Subject'}: the {' and '.join(unknown)} {verb} not known. Set {wanted} in session.toml.")


@dataclass(frozen=True, eq=False)
class Session:
    """One visit of one person: the subject, the trials that were read, and the files that were refused with the reason.

    ``refused`` maps a file name to the sentence why. ``notes`` are the guesses made (roles by name, sex unknown ...), each said.
    """

    subject: Subject
    trials: tuple[Trial, ...]
    folder: Path
    refused: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if any(trial.settings != self.settings for trial in self.trials):
            raise BiodanceError("The trials of this session were read with different settings. Read them again together.")

    @property
    def settings(self) -> Settings:
        """What the analyst chose, the same for all trials."""
        return self.trials[0].settings if self.trials else USUAL

    def of_role(self, *roles: Role) -> tuple[Trial, ...]:
        """Return the trials with one of the given roles, in order."""
        return tuple(t for t in self.trials if t.role in roles)


@dataclass(frozen=True, eq=False)
class Sip:
    """Standard inertial parameters of N segments with their covariance.

    ``segments`` (N) names; ``phi`` (10N,) segment-major, per segment Pinocchio's order [m, mcx, mcy, mcz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz] in
    kg, kg·m, kg·m², first moment and inertia about and in the segment's JOINT frame; ``covariance`` (10N, 10N) in the same units.
    """

    segments: tuple[str, ...]
    phi: Array
    covariance: Array

    def __post_init__(self) -> None:
        n = 10 * len(self.segments)
        _set(
            self,
            segments=tuple(self.segments),
            phi=frozen_array(self.phi, (n,), "Sip.phi"),
            covariance=frozen_array(self.covariance, (n, n), "Sip.covariance"),
        )

    def of(self, segment: str) -> Array:
        """Return the 10 parameters of one segment."""
        if segment not in self.segments:
            raise UnknownName.of("segment", segment, self.segments)
        i = self.segments.index(segment)
        return self.phi[10 * i : 10 * i + 10]

    @property
    def mass(self) -> Array:
        """(N,) kg."""
        return self.phi[::10]

    @property
    def com(self) -> Array:
        """(N, 3) m, centre of mass in the segment's joint frame; NaN for a massless segment."""
        table = self.phi.reshape(-1, 10)
        mass = np.where(table[:, :1] > 0, table[:, :1], np.nan)
        return table[:, 1:4] / mass
