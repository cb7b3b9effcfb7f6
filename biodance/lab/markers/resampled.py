"""Markers of rows with changing time steps on equal ones: what no body does is taken out before it can spread."""

from biodance.lab.markers.signals import faulty_markers, without_faults
from biodance.lab.markers.time_axis import TimeAxis
from biodance.records import Array, Markers


def resampled(names: tuple[str, ...], xyz: Array, axis: TimeAxis) -> tuple[Markers, list[str]]:
    """Return markers ``xyz`` (S, K, 3) m of rows on the time of their ``axis``, and what was taken as not seen, one
    sentence a marker; markers with equal steps as they are: `prepare` looks at these.
    """
    if not axis.sampled:
        return Markers(names, axis.time, xyz), []
    rows = Markers(names, axis.stamps, xyz)
    faults = faulty_markers(rows)
    seen = without_faults(rows, faults)
    return Markers(names, axis.time, axis.at(seen.xyz)), [one.sentence(one.when(axis.stamps)) for one in faults]
