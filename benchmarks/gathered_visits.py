"""A visit with what identification needs of it, from the cache while the code of identify/ on which it depends is
unchanged.
"""

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path

from kept_files import kept
from virtual_visits import CACHE, TrackedVisit, visit

import biodance
from biodance.identification.identification import Identification, conclude, conclude_trials
from biodance.identification.learning import learn_noise
from biodance.identification.loads import with_unknown_load
from biodance.identification.mismatch import Mismatch, mismatch
from biodance.identification.statistics import Statistics, empty, layout_for, statistics, usable
from biodance.library import locate
from biodance.records import Subject
from biodance.uncertainty.caution import widened
from biodance.uncertainty.noise import Noise


@dataclass(frozen=True, eq=False)
class Gathered:
    """A visit with what identification needs of it: statistics, learned noise, disturbances."""

    visit: TrackedVisit
    total: Statistics
    noise: Noise
    found: Mismatch

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the fitted trials."""
        return tuple(fit.name for fit in self.visit.fits)

    def identified(self) -> Identification:
        """Return the identification: `conclude_trials`, without learning again what is kept here."""
        one = self.visit
        found = conclude(one.body, self.total, self.names, noise=self.noise, found=self.found)
        return conclude_trials(one.body, self.total, one.fits) if found.diluted else found


SOURCES = ("statistics", "learning", "loads", "mismatch")
"""Modules of identify/ on which what is gathered depends, beside all of uncertainty/ and its table."""


def gather(
    subject: Subject, protocol: str, seed: int, *, session: int = 0, load: tuple[str, float] | None = None
) -> Gathered:
    """Return the statistics, the noise and the disturbances of a visit, from the cache while their code is
    unchanged.
    """
    folder = Path(biodance.identification.__file__).parent
    room, table = folder.parent / "uncertainty", locate("anthropometry/uncertainty", "sizes", ".csv")
    parts = [*(folder / f"{name}.py" for name in SOURCES), *sorted(room.glob("*.py")), table]
    code = b"".join(path.read_bytes() for path in parts)
    key = f"{subject}-{protocol}-{seed}-{session}-{load}".encode() + code
    path = CACHE / f"gathered-{hashlib.sha256(key).hexdigest()[:20]}.pickle"
    return kept(path, lambda: _gathered(visit(subject, protocol, seed=seed, session=session, load=load)))


def _gathered(one: TrackedVisit) -> Gathered:
    used, about, _ = usable(one.body, one.fits)
    one = replace(one, fits=used)
    layout = layout_for(about)
    total = empty(10 * len(one.body.segments), layout)
    for fit in one.fits:
        total = total + statistics(one.body, fit, layout)
    noise, _ = learn_noise(total, with_unknown_load(one.body, widened(one.body.sip)))
    return Gathered(one, total, noise, mismatch(one.body, one.fits, noise))
