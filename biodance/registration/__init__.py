"""The pose of every plate and the delay of their clock with intervals, or the reason why they cannot be told; and
markers and registered plates as an ordinary session, one C3D file with both.
"""

import json
import re
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from biodance import display
from biodance.errors import SessionRefused, TrialRefused
from biodance.identification.knowledge import SIGMAS
from biodance.lab.c3d.subject import as_written
from biodance.lab.c3d.write import PlateRecording, plate_recording, write_c3d
from biodance.lab.plates.decode import plate_axes
from biodance.lab.session.file import FILES
from biodance.lab.session.results_folder import whole_folder
from biodance.records import Array, Markers, Plate, Session, Trial, Wrench, freeze
from biodance.registration.alignment import Alignment, Forces, FramePose
from biodance.registration.refinement import ENOUGH_ROWS, HEIGHT_SD, Refined

if TYPE_CHECKING:
    import pandas as pd


def rival_delays(
    hypotheses: tuple[Alignment, ...], found: Refined, refine: Callable[[FramePose], Refined]
) -> tuple[Alignment, ...]:
    """Return the hypotheses after the first, refined to ``found``, that are not clearly worse: of the three that
    explain most, those that explain 85 % of it.
    """
    near = [one for one in hypotheses[1:] if one.gain > 0.85 * hypotheses[0].gain][:3]
    if found.rows < ENOUGH_ROWS:
        return tuple(near)
    remaining = []
    for one in near:
        with suppress(TrialRefused):
            other = refine(one.pose)
            # Log likelihood ratio: half the difference of the sums of squares (mean square times rows).
            worse = 0.5 * min(found.rows, other.rows) * (other.fit - found.fit)
            apart = abs(other.pose.delay - found.pose.delay) >= 0.03  # else both, refined, are one
            clearly_worse = other.rows < ENOUGH_ROWS or (np.isfinite(worse) and worse > 10.0)
            if apart and not clearly_worse:
                remaining.append(one)
    return tuple(remaining)


_SURE = 1.645
"""Standard deviations that must fit into a limit. At the limit one in ten errs beyond it; most lie well below: of 24
simulated trials that pass 23 are within all limits."""
_STRANGE = 7.5
"""Misfit of a loaded sample (of 12) above which the movement is not the one that the plates felt: 39 true pairs have up
to 6.6."""


@dataclass(frozen=True)
class Limits:
    """How exact a pose must be (90 %): ``across`` and ``along`` m, the better and the worse known horizontal direction;
    ``yaw`` rad; ``delay`` s.
    """

    across: float = 0.005
    along: float = 0.010
    yaw: float = float(np.radians(0.5))
    delay: float = 0.005


@dataclass(frozen=True, eq=False)
class PlacedPlate:
    """Where one plate lies: ``position`` (3,) m of its surface's centre in the room with ``sd`` (3,); ``yaw`` rad from
    room x to the plate's x (corners in the file's order) with ``yaw_sd``; whether it was ``loaded``.
    """

    name: str
    position: Array
    sd: Array
    yaw: float
    yaw_sd: float
    loaded: bool

    def __post_init__(self) -> None:
        freeze(self, "PlacedPlate", position=(3,), sd=(3,))

    def document(self) -> dict[str, Any]:
        """Return it as plain values, the unit in the key."""
        return {
            "name": self.name,
            "position_m": self.position.tolist(),
            "yaw_rad": self.yaw,
            "sd_m": self.sd.tolist(),
            "yaw_sd_rad": self.yaw_sd,
            "loaded": self.loaded,
        }


@dataclass(frozen=True, eq=False)
class Registration:
    """Where the plates of a force file lie in the room of the markers, and how late its clock is.

    Parameters
    ----------
    status : {"registered", "rough", "refused"}
        "registered": as exact as asked for; "rough": less exact, and written because that was asked for.
    reason : str
        Why it is not "registered"; "" where it is.
    pose : FramePose or None
        Of the force file's frame and clock; None where there is not even a guess.
    delay_sd : float
        s.
    plates : tuple of PlacedPlate
        In the file's order.
    notes : tuple of str
        What it rests on.

    Examples
    --------
    >>> registered  # doctest: +ELLIPSIS
    Registration(registered: delay ... ms, plate1 at ...)
    """

    status: Literal["registered", "rough", "refused"]
    reason: str
    pose: FramePose | None = None
    delay_sd: float = float("nan")
    plates: tuple[PlacedPlate, ...] = ()
    notes: tuple[str, ...] = field(default=())

    def __repr__(self) -> str:
        if self.pose is None:
            return f"Registration({self.status}: {self.reason})"
        where = ", ".join(
            f"{one.name} at {one.position[0]:.3f}, {one.position[1]:.3f} m ± {1e3 * SIGMAS * one.sd[:2].max():.0f} mm, "
            f"{np.degrees(one.yaw):.1f} ± {np.degrees(SIGMAS * one.yaw_sd):.1f} deg"
            for one in self.plates
        )
        late = f"delay {1e3 * self.pose.delay:.1f} ± {1e3 * SIGMAS * self.delay_sd:.1f} ms"
        return f"Registration({self.status}: {late}, {where})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), self.table(), (*([self.reason] if self.reason else []), *self.notes))

    def document(self) -> dict[str, Any]:
        """Return what `biodance register --json` prints (CONTRACT.md), SI units, None for what is not known.

        Returns
        -------
        dict
            status, reason, delay_s, delay_sd_s, plates, file_frame (pose of the force file's frame), notes, attention.

        Examples
        --------
        >>> registered.document()["plates"][0]["name"]
        'plate1'
        """
        level, pose = "fail" if self.status == "refused" else "warn", self.pose
        said = {"level": level, "text": self.reason, "trial": "", "about": "register"}
        return {
            "status": self.status,
            "reason": self.reason,
            "delay_s": None if pose is None else pose.delay,
            "delay_sd_s": None if pose is None else self.delay_sd,
            "plates": [one.document() for one in self.plates],
            "file_frame": None if pose is None else {"shift_m": pose.shift.tolist(), "yaw_rad": _within(pose.yaw)},
            "notes": list(self.notes),
            "attention": [said] if self.reason else [],
        }

    def table(self) -> "pd.DataFrame":
        """Return one row for each plate.

        Returns
        -------
        pandas.DataFrame
            plate, x, y, z (m), yaw (rad) and their sd, loaded.

        Examples
        --------
        >>> len(registered.table())
        1
        """
        import pandas as pd

        rows = [(one.name, *one.position, one.yaw, *one.sd, one.yaw_sd, one.loaded) for one in self.plates]
        names = ["plate", "x", "y", "z", "yaw", "sd_x", "sd_y", "sd_z", "sd_yaw", "loaded"]
        return pd.DataFrame(rows, columns=names)


def _within(angle: float) -> float:
    """Return an angle between -pi and pi."""
    # Through the unit circle: wraps to (-pi, pi].
    return float(np.angle(np.exp(1j * angle)))


def concluded(
    forces: Forces,
    best: Alignment,
    found: Refined,
    rivals: tuple[Alignment, ...],
    *,
    limits: Limits,
    rough: bool = False,
) -> Registration:
    """Return the registration, refused where one of ``rivals`` is nearly as good, where the movement is not the one
    that the plates felt, or where it shows the pose less exactly than ``limits`` (unless ``rough`` is enough).
    """
    doubt, wide = _doubt(best, rivals, found), _too_wide(found.covariance, limits)
    status: Literal["registered", "rough", "refused"] = "rough" if wide else "registered"
    if doubt or (wide and not rough):
        status = "refused"
    plates = tuple(_placed(plate, bool(on), found) for plate, on in zip(forces.plates, forces.loaded, strict=True))
    notes = [f"It rests on {found.seconds:.1f} s of fully measured contact and {found.steps} steps on plates."]
    notes += found.notes
    if len(plates) > 1:
        notes.append(f"The {len(plates)} plates keep the places relative to one another that their file gives.")
    if idle := [plate.name for plate in plates if not plate.loaded]:
        notes.append(f"Never stepped on: {', '.join(idle)}.")
    delay_sd = float(np.sqrt(found.covariance[3, 3]))
    return Registration(status, doubt or wide, found.pose, delay_sd, plates, tuple(notes))


def _doubt(best: Alignment, rivals: tuple[Alignment, ...], found: Refined) -> str:
    """Return why the pose is not believed at all; "" where it is."""
    # Mean square of the wrench's whitened rows: true pairs have up to 2.
    if found.rows >= ENOUGH_ROWS and found.fit > 5.0:
        return (
            f"The forces do not fit this movement (the wrench misses by {np.sqrt(found.fit):.1f} times "
            "what is usual): they are of another trial or person. Give the two files of one trial."
        )
    if best.misfit > _STRANGE:
        return (
            f"The forces do not fit this movement (misfit {best.misfit:.1f} of at most 12, {_STRANGE:g} allowed): they "
            "are of another trial or person, or the body's mass is wrong. Give the two files of one trial."
        )
    if rivals:
        late, turned = rivals[0].pose.delay - best.pose.delay, _within(rivals[0].pose.yaw - best.pose.yaw)
        return (
            f"A second solution is nearly as good ({100 * rivals[0].gain / best.gain:.0f} % of what the best one "
            f"explains): {late:+.2f} s of delay and {np.degrees(turned):+.0f} degrees of yaw from the best. Record a "
            "movement that does not repeat itself: a step aside, a one-leg stance, one fast squat."
        )
    if found.misfit > 6.0:
        return (
            f"The pressure does not lie in the feet as it does in people (misfit {found.misfit:.1f}, 1 expected): the "
            "plates do not lie to one another as their file says, or it is another movement. Give one plate at a time."
        )
    return ""


def _too_wide(covariance: Array, limits: Limits) -> str:
    """Return what is known less exactly than asked for (90 %); "" where nothing is."""
    # Principal axes of the horizontal error ellipse; eigenvalues ascend, so the better known one is first.
    across, along = np.sqrt(np.linalg.eigvalsh(covariance[:2, :2]))
    yaw, delay = np.sqrt(np.diag(covariance)[2:])
    rows = [
        (across, limits.across, 1e3, "mm in the better known direction"),
        (along, limits.along, 1e3, "mm in the other"),
        (yaw, limits.yaw, 180 / np.pi, "degrees of yaw"),
        (delay, limits.delay, 1e3, "ms of delay"),
    ]
    told = [
        f"{_SURE * f * sd:.2g} {what} ({f * most:.2g} asked for)" for sd, most, f, what in rows if _SURE * sd > most
    ]
    if not told:
        return ""
    return (
        f"The movement shows the pose only to ± {', ± '.join(told)}, at 90 %. Record squats, or steps in several "
        "directions, beside the trial; or take what is known with --rough."
    )


def _placed(plate: Plate, loaded: bool, found: Refined) -> PlacedPlate:
    """Return one plate in the room with the intervals at its own centre."""
    centre = found.pose.points(plate.centre)
    x, y = (centre - found.about)[:2]
    # by how much the plate's own centre moves with x, y, yaw and delay of the pose
    slope = np.array([[1.0, 0.0, -y, 0.0], [0.0, 1.0, x, 0.0]])
    # Variance of a linear function: slope C slope'.
    flat = np.sqrt(np.diag(slope @ found.covariance @ slope.T))
    right = found.pose.points(plate.corners)
    # From the middle of corners 1 and 2 to that of 0 and 3: the plate's x.
    axis = right[[0, 3]].mean(axis=0) - right[[1, 2]].mean(axis=0)
    sd = np.array([*flat, HEIGHT_SD])
    yaw_sd = float(np.sqrt(found.covariance[2, 2]))
    return PlacedPlate(plate.name, centre, sd, float(np.arctan2(axis[1], axis[0])), yaw_sd, loaded)


_MARK = "registration.json"
"""Name of the file that says that a folder was written by `biodance register`."""


def registered_folder(folder: Path, *, force: bool) -> Path:
    """Return the folder for a registered session, which is missing, empty, or with ``force`` an earlier one; nothing is
    made or removed yet.

    Raises
    ------
    SessionRefused
        It is a file, or holds files: others' always, those of an earlier registration without ``force``.
    """
    if folder.exists() and not folder.is_dir():
        raise SessionRefused(f"{folder}: is a file; a session needs a folder. Choose another name.")
    files = sorted(folder.iterdir()) if folder.is_dir() else []
    if files and not (folder / _MARK).is_file():
        raise SessionRefused(
            f"{folder}: holds files that biodance did not write ({files[0].name}). Choose another name."
        )
    if files and not force:
        raise SessionRefused(f"{folder}: holds an earlier registration. Choose another name, or --force.")
    return folder


def write_registered(
    folder: Path, session: Session, trial: Trial, plates: Sequence[Plate], *, said: Mapping[str, Any]
) -> Path:
    """Write ``trial`` (as read, any format) with ``plates`` in the room and on the markers' clock into ``folder``, the
    static trials and the subject's files of its ``session`` beside it, and what was ``said`` of the plates as
    `registration.json`; return the C3D file. An earlier registration in the folder is replaced.

    Frames of markers that the plates do not cover are left out, as C3D holds no unknown force.

    Raises
    ------
    SessionRefused
        The two share no time.
    """
    assert trial.markers is not None
    markers, recorded, rate = _common(trial.markers, plates)
    path, first = folder / f"{trial.source.path.stem}.c3d", trial.source.first_frame
    first += int(np.searchsorted(trial.markers.time, markers.time[0]))
    typed = {"PROCESSING": as_written(trial.measurements)} if trial.measurements else None
    with whole_folder(folder, over=True) as part:
        c3d = part / path.name
        write_c3d(c3d, markers=markers, plates=recorded, analog_rate=rate, parameters=typed, first_frame=first)
        _copy_beside(session, trial, part)
        (part / _MARK).write_text(json.dumps(said, indent=1) + "\n", encoding="utf-8")
        # What lies in the folder of an earlier registration and was not written by it.
        inside = sorted(folder.iterdir()) if folder.is_dir() else []
        for file in [
            one for one in inside if one.is_dir() or not (one.suffix == ".c3d" or one.name in (*FILES, _MARK))
        ]:
            if not (part / file.name).exists():
                shutil.copy2(file, part / file.name) if file.is_file() else shutil.copytree(file, part / file.name)
    return path


def _copy_beside(session: Session, trial: Trial, folder: Path) -> None:
    """Copy the static trials and the subject's files of a session, without what they say of the plates."""
    own = trial.source.path.parent
    for static in session.of_role("static"):
        if static.source.path != trial.source.path:
            shutil.copyfile(static.source.path, folder / static.source.path.name)
    for file in sorted(own.iterdir()):
        if file.is_file() and file.suffix.lower() in (".mp", ".vsk", ".enf", ".toml"):
            shutil.copyfile(file, folder / file.name)
    for name in FILES:
        if (own.resolve().parent / name).is_file() and not (folder / name).exists():
            shutil.copyfile(own.resolve().parent / name, folder / name)
    # the tables [plates.NAME] of a copied file are about plates as they were before
    for path in (folder / name for name in FILES if (folder / name).is_file()):
        text = path.read_text(encoding="utf-8")
        path.write_text(re.sub(r"(?ms)^\[plates\b.*?(?=^\[[A-Za-z]|\Z)", "", text), encoding="utf-8")


def _common(markers: Markers, plates: Sequence[Plate]) -> tuple[Markers, list[PlateRecording], float]:
    """Return the markers within the plates' time and what the plates record at a whole multiple of their rate."""
    from scipy.interpolate import make_interp_spline

    time = plates[0].wrench.time
    many = max(1, round(plates[0].wrench.rate / markers.rate))
    step = 1.0 / markers.rate
    # A frame is kept where all its samples lie within what the plates recorded.
    kept = np.flatnonzero((markers.time >= time[0]) & (markers.time + (many - 1) / many * step <= time[-1]))
    if kept.size < 2:
        raise SessionRefused("Markers and plates share no time, so there is nothing to write.")
    seen = Markers(markers.names, markers.time[kept], markers.xyz[kept])
    # Every frame and the samples between it and the next.
    fine = (seen.time[:, None] + step / many * np.arange(many)).ravel()
    recordings = []
    for plate in plates:
        value = make_interp_spline(time, plate.wrench.value, k=3)(fine)
        down = plate_axes(plate.corners)[2, 2] < 0  # the order of corners that a plate of TYPE 2 has
        corners = plate.corners if down else plate.corners[[1, 0, 3, 2]]
        recordings.append(plate_recording(replace(plate, corners=corners, wrench=Wrench(fine, np.asarray(value)))))
    return seen, recordings, many * markers.rate
