"""From the trials of a session to what the subject weighs, segment by segment, with an interval for every number.

The steps: band-wise statistics of every trial, noise learned, what wrong kinematics and plates could do discounted
(twins), the table as prior (maximum a posteriori: its standard deviations and the noise of the data decide, no weight
is tuned), then the nearest body that can exist. A session that cannot tell a parameter leaves it at the table's value
with the table's interval, and says so.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

from biodance import display
from biodance.body.body import Body
from biodance.errors import NotSolved, UnknownName
from biodance.identification.base_parameters import BaseEstimate, estimate_base, structural_base
from biodance.identification.knowledge import QUANTITIES, Known, knowledge, known_interval, known_together
from biodance.identification.loads import PossibleTables, more_probable_table, possible_tables, unknown_loads, with_room
from biodance.identification.mismatch import Calibrated, Mismatch, Sizes, discounted, mismatch, softness, undo_dilution
from biodance.identification.physical import FailedFit, PhysicalFit, physical_fit
from biodance.identification.posterior import BodyPosterior, Information, find_posterior
from biodance.identification.statistics import Fit, Statistics, learn_noise, statistics, usable
from biodance.records import Sip
from biodance.threads import Sendable, one_thread
from biodance.uncertainty.bands import Noise
from biodance.uncertainty.caution import from_true_centres, widened_prior

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

NOISE_ALONE = (
    "The intervals count the noise alone, not soft tissue, joint centres and plates: they are several times too short."
)

_TOO_SLOW = (
    "Movement faster than {:g} Hz was left out: there is so little of it that it cannot be told from skin that slides."
)


@dataclass(frozen=True, eq=False)
class Identification(Sendable):
    """What a session says about a body.

    Parameters
    ----------
    body : Body
        As given, with the table as its inertial parameters.
    posterior : BodyPosterior
        The Gaussian posterior before the consistency constraint.
    data : Information
        What the trials alone say: whitened, disturbances discounted.
    base : BaseEstimate
        Weighted least-squares estimate of the base parameters.
    noise : Noise
        As learned.
    sizes : Sizes
        Of the disturbances.
    fit : PhysicalFit
        The nearest body that can exist, its covariance about the true joint centres, or why there is none.
    trials : tuple of str
        Used.
    frames : int
        Coefficients counted.
    known : tuple
        Every quantity of every segment with interval and verdict; () where the fit failed.
    notes : tuple of str
        What a person should know.
    apart : bool
        Whether the prior takes the masses of right and left each on its own, by evidence.
    diluted : bool
        Whether noise in the kinematics takes from the parameters what cannot be given back.

    References
    ----------
    Physical consistency: Traversaro et al. 2016, doi:10.1109/IROS.2016.7759801; Wensing et al. 2018,
    doi:10.1109/LRA.2017.2729659.

    Examples
    --------
    >>> identified.identification
    Identification(solved, 12 segments from dance_1)
    """

    body: Body
    posterior: BodyPosterior
    data: Information
    base: BaseEstimate
    noise: Noise
    sizes: Sizes
    fit: PhysicalFit | FailedFit
    trials: tuple[str, ...]
    frames: int
    known: tuple[Known, ...]
    notes: tuple[str, ...]
    apart: bool = False
    diluted: bool = False

    def __repr__(self) -> str:
        return f"Identification({self.status}, {len(self.sip.segments)} segments from {', '.join(self.trials)})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), self.table(), self.notes)

    def table(self, quantity: str = "mass") -> "pd.DataFrame":
        """Return one row for each segment.

        Parameters
        ----------
        quantity : str
            "mass" (kg); "com x", "com y", "com z" (m, in the segment's joint frame); "Ixx" ... "Izz" (kg·m², about the
            centre of mass).

        Returns
        -------
        pandas.DataFrame
            Index segment; table, table sd, identified, sd, low and high of the 95 % interval, each with its unit;
            ``from data`` (share of the table's variance that the data removed), verdict.

        Raises
        ------
        UnknownName
            There is no such quantity; the legal ones are listed.

        Examples
        --------
        >>> bool(identified.identification.table("com y").loc["left_thigh", "identified (m)"] < 0)
        True
        """
        import pandas as pd

        if quantity not in QUANTITIES:
            raise UnknownName.of("quantity of a segment", quantity, QUANTITIES)
        rows = [k for k in self.known if k.quantity == quantity]
        numbers = [(k.table, k.table_sd, k.value, k.sd, *k.interval) for k in rows]
        columns = [f"{name} ({rows[0].unit})" for name in ("table", "table sd", "identified", "sd", "low", "high")]
        out = pd.DataFrame(numbers, pd.Index([k.segment for k in rows], name="segment"), columns)
        out["from data"] = [k.from_data for k in rows]
        out["verdict"] = [k.verdict for k in rows]
        return out

    def plot_masses(self, *, axes: "Axes | None" = None) -> "Axes":
        """Draw the mass of every segment, of the table and identified, with 95 % intervals.

        Parameters
        ----------
        axes : matplotlib.axes.Axes, optional
            Where to draw; by default a new figure.

        Returns
        -------
        matplotlib.axes.Axes
            Kilograms; squares are the table's, circles identified: filled = known, pale = partly known, open = cannot
            be known.

        Examples
        --------
        >>> identified.identification.plot_masses().get_xlabel()
        'mass (kg), 95 % intervals'
        """
        drawn = display.intervals(
            [known_interval(known) for known in self.known if known.quantity == "mass"], axes=axes
        )
        drawn.set_xlabel("mass (kg), 95 % intervals")
        return drawn

    @property
    def status(self) -> Literal["solved", "failed"]:
        """Whether a body that can exist was found; if it "failed", `cause` says why and what to do."""
        return self.fit.status

    @property
    def cause(self) -> str:
        """Cause and cure of a failure in words, "" if there is none."""
        return self.fit.cause

    @property
    def sip(self) -> Sip:
        """The identified parameters, physically consistent, with their covariance about the true joint centres.

        Raises
        ------
        NotSolved
            The fit failed, so there are none.
        """
        if self.fit.status == "failed":
            raise NotSolved(f"Nothing was identified from {', '.join(self.trials)}. {self.fit.cause}")
        return self.fit.sip

    @cached_property
    def identified(self) -> Body:
        """The body with the identified parameters; raises `NotSolved` like `sip`."""
        notes = (*self.body.notes, f"SIP identified from {', '.join(self.trials)}.")
        return replace(self.body, sip=self.sip, notes=notes, at_joint=None)

    @property
    def unknown(self) -> tuple[Known, ...]:
        """The quantities that this session cannot know: the table's."""
        return tuple(k for k in self.known if k.verdict == "cannot be known")


@one_thread()
def identify_body(body: Body, fits: tuple[Fit, ...], *, prior: Sip | None = None) -> Identification:
    """Return the identified parameters of ``body`` from the trials ``fits``; ``prior`` is what is known before (by
    default the table in ``body.sip``, its standard deviations widened for frames that marker placement turns).

    Trials without a usable frame are left out and named in the notes.

    Raises
    ------
    TrialRefused
        There is no trial, or none has a usable frame.
    """
    used, about, notes = usable(body, fits)
    found = conclude_trials(body, statistics(body, used, Noise.unit(about)), used, prior=prior)
    return replace(found, notes=(*notes, *found.notes))


@one_thread()
def conclude_trials(
    body: Body, total: Statistics, fits: tuple[Fit, ...], *, prior: Sip | None = None
) -> Identification:
    """Return the identification from the statistics ``total`` of the trials ``fits``, disturbances counted.

    Where movement is so slow that what its fastest band shows cannot be told from noise in the kinematics (regression
    dilution that cannot be given back, `dilution.gains_move_masses`), that band is left out.
    """
    before, loads = prior or widened_prior(body.sip, body.joint_errors), unknown_loads(body)
    tables = possible_tables(before, body) if prior is None else {(False, False): before}
    room, softer = with_room(before, loads), softness(body, fits, total.layout.bands)

    def calibrated(some: Statistics) -> Calibrated:
        noise = learn_noise(some, room)
        found = mismatch(body, fits, noise, softer=softer)
        return undo_dilution(body, some, discounted(some, noise, found, room), found, tables, room, loads)

    got, names = calibrated(total), tuple(fit.name for fit in fits)
    if not got.diluted:
        return _concluded(body, got, tables, names)
    slower = _concluded(body, calibrated(total.slower()), tables, names)
    return replace(slower, notes=(*slower.notes, _TOO_SLOW.format(total.layout.bands.edges[-2])))


@one_thread()
def conclude(
    body: Body,
    total: Statistics,
    trials: tuple[str, ...],
    *,
    noise: Noise | None = None,
    found: Mismatch | None = None,
    machine: bool = False,
) -> Identification:
    """Return the identification from statistics that were gathered already, of several trials or of a stream of frames.

    ``noise`` as learned (learned here if None); ``found`` what twins and plates disturb: without it the intervals count
    noise alone, far too short, and the notes say so; of a ``machine`` all that is known before is ``body.sip``.
    """
    before = body.sip if machine else widened_prior(body.sip, body.joint_errors)
    room = before if machine else with_room(before, unknown_loads(body))
    tables = {(False, False): before} if machine else possible_tables(before, body)
    got = discounted(total, noise or learn_noise(total, room), found, room)
    done = _concluded(body, got, tables, trials, machine=machine)
    return done if found else replace(done, notes=(NOISE_ALONE, *done.notes))


def _concluded(
    body: Body, got: Calibrated, tables: PossibleTables, trials: tuple[str, ...], *, machine: bool = False
) -> Identification:
    """Return the identification from calibrated data, under the one of the ``tables`` that they make most probable."""
    before, apart, words = more_probable_table(got.data, tables, body)
    posterior = find_posterior(got.data, before)
    fit, base = physical_fit(posterior, body), estimate_base(got.data, structural_base(body))
    known: tuple[Known, ...] = ()
    if fit.status == "solved":
        first = before
        if not machine:
            fit = replace(fit, sip=from_true_centres(fit.sip, before, body.joint_errors))
            first = from_true_centres(before, before, body.joint_errors)
        known = knowledge(fit.sip, first, posterior)
        words += _notes(known, fit)
    own = got.noise, got.sizes, fit, trials, got.data.frames, known, words, apart, got.diluted
    return Identification(body, posterior, got.data, base, *own)


def _notes(known: tuple[Known, ...], fit: PhysicalFit) -> tuple[str, ...]:
    notes = []
    lost = [
        f"{k.segment.replace('_', ' ')} {k.quantity}"
        for k in known
        if k.verdict == "cannot be known" and not k.quantity.startswith("I")
    ]
    if lost:
        notes.append(f"Cannot be known from this session (the table's value stands): {', '.join(lost)}.")
    notes += [str(together) for together in known_together(fit.sip)]
    moved = [display.spaced(name) for name, acts in zip(fit.sip.segments, fit.moved, strict=True) if acts]
    if moved:
        notes.append(f"At the edge of what a body can be: {', '.join(moved)}.")
    return tuple(notes)
