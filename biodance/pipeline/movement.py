"""What moved in a visit: every trial's events, cycles and curves, with the parameters that the visit identified."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from biodance import display
from biodance.body.body import Body
from biodance.cycles.curves import NormalCurve
from biodance.cycles.cut import STRIDE_UNITS
from biodance.cycles.movement import TrialMovement, trial_movement
from biodance.errors import BiodanceError, TrialRefused
from biodance.lab.c3d.subject import FileOutputs, read_outputs
from biodance.motion.contact.contact import Contact, ground_contact
from biodance.motion.contact.soles import soles_from_body
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial_result import TrialResult
from biodance.records import Sip, Trial, by_name
from biodance.threads import one_thread

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class SessionMovement:
    """What moved in a visit; ``moved["walk_1"]`` is one trial.

    Parameters
    ----------
    name : str
        Of the session.
    trials : tuple of TrialMovement
        Of all trials that give a motion.
    parameters : {"identified", "table"}
        Whose inertial parameters the moments and powers are computed with.
    mass : float
        kg that moments and powers are divided by: of that body.
    left_out : mapping
        Trial -> why nothing is told of its movement.
    normal : tuple of NormalCurve
        Bands of the laboratory's own people to be shown behind (`learn_laboratory`).

    Examples
    --------
    >>> biodance.describe_movement(result)
    SessionMovement('visit': squat_1 3 squats)
    """

    name: str
    trials: tuple[TrialMovement, ...]
    parameters: str
    mass: float
    left_out: dict[str, str]
    normal: tuple[NormalCurve, ...] = ()

    def __repr__(self) -> str:
        said = ", ".join(f"{one.trial} {one.told}" for one in self.trials if one.cycles)
        return f"SessionMovement({self.name!r}: {said or 'no repetition in any trial'})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), self.spatiotemporal(), [f"{k}: {v}" for k, v in self.left_out.items()])

    def __getitem__(self, trial: str) -> TrialMovement:
        """Return the movement of one trial; UnknownName lists all names."""
        return by_name(self.trials, trial, f"trial with a movement of session {self.name}")

    def __iter__(self) -> Iterator[TrialMovement]:
        return iter(self.trials)

    def table(self) -> "pd.DataFrame":
        """Return mean and sd of every curve of every trial.

        Returns
        -------
        pandas.DataFrame
            As `TrialMovement.table`, with the trial in front.

        Examples
        --------
        >>> set(biodance.describe_movement(result).table()["trial"])
        {'squat_1'}
        """
        import pandas as pd

        parts = []
        for one in self.trials:
            part = one.table()
            part.insert(0, "trial", one.trial)
            parts.append(part)
        some = [part for part in parts if len(part)] or parts[:1]
        return pd.concat(some, ignore_index=True) if some else pd.DataFrame(columns=["trial"])

    def spatiotemporal(self) -> "pd.DataFrame":
        """Return the spatio-temporal values of walking.

        Returns
        -------
        pandas.DataFrame
            trial, quantity, unit, side, mean, sd, count; no rows where nobody walks.

        Examples
        --------
        >>> len(biodance.describe_movement(result).spatiotemporal())
        0
        """
        import pandas as pd

        rows = [
            (one.trial, name, STRIDE_UNITS[name], side, *values)
            for one in self.trials
            for side in ("both", "left", "right")
            for name, values in one.spatiotemporal(side).items()
        ]
        return pd.DataFrame(rows, columns=["trial", "quantity", "unit", "side", "mean", "sd", "count"])


@one_thread()
def session_movement(session: SessionResult, *, tell: Callable[[str], None] = lambda _: None) -> SessionMovement:
    """Return what moved in an examined session; see `describe_movement`."""
    found = session.identification
    solved = found is not None and found.status == "solved"
    sip = found.identification.sip if found is not None and solved else None
    trials, left_out = [], {}
    for k, one in enumerate(session.trials, 1):
        tell(f"describing {one.name}, {k} of {len(session.trials)}")
        try:
            trials.append(movement_of(one, session.body, sip))
        except BiodanceError as why:
            left_out[one.name] = str(why)
    mass = sip if sip is not None else session.body.sip if session.body else None
    kg = float(mass.mass.sum()) if mass is not None else float("nan")
    return SessionMovement(session.session.folder.name, tuple(trials), "identified" if sip else "table", kg, left_out)


def movement_of(one: TrialResult, body: Body | None, sip: Sip | None) -> TrialMovement:
    """Return what moved in one examined trial; ``sip`` None: moments with the body's own parameters.

    Raises
    ------
    TrialRefused
        The trial gives no motion, or one too short.
    """
    if body is None or one.motion is None:
        raise TrialRefused(f"Trial {one.name}: it gives no motion. {one.reason}".strip())
    contact = contact_of(one.trial, one, body)
    return trial_movement(one.trial, body, one.motion, sip=sip, contact=contact, outputs=_outputs(one.trial))


def contact_of(trial: Trial, one: TrialResult, body: Body) -> Contact | None:
    """Return the ground contact of an examined trial; None without plates, or where it is refused."""
    if one.contact is not None or not trial.plates or one.motion is None:
        return one.contact
    try:
        return ground_contact(trial, soles_from_body(body, one.motion), mass=float(body.sip.mass.sum()))
    except BiodanceError:
        return None


def _outputs(trial: Trial) -> FileOutputs | None:
    """Return what another program wrote into the trial's file; None where it is no C3D file or cannot be read again."""
    if trial.source.format != "C3D":
        return None
    try:
        return read_outputs(trial.source.path)
    except BiodanceError:
        return None
