"""A marker does not sit where the static trial put it: it was knocked, re-glued, or slid with a strap.

Signature: the mean residual of this marker and, with opposite sign, of the others on its segment; the segment turns a
little, and the wrench with it. Look-alikes: a wrong centre of a joint of the same segment; a soft spot under the
marker. Separated by more markers on the segment and by a second static trial at the end. A marker that was wrong in the
static trial, too, is a wrong joint centre.
"""

from dataclasses import replace

import numpy as np

from biodance.body.changes import move_marker
from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter
from biodance.motion.track import track
from biodance.records import Array


class MarkerMisplaced(Effect):
    """A ``shift`` (x, y, z: m, axes of its segment) from where the model has the marker ``target`` to where it sits."""

    name = "marker_misplaced"
    parameters = tuple(
        Parameter(f"shift_{axis}", "m", 0.010, "up to 20-30 mm between examiners (Osis 2016, PLoS ONE 0147111)")
        for axis in "xyz"
    )
    placed = True
    separated_by = "A second static trial at the end of the session shows where the marker sits now."
    advice = "Look at the marker on the video; record another static trial and scale the body on it."

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return the markers that the trial has and the tracking counts."""
        markers = case.body.markers
        return tuple(markers.names[c] for c in case.marker_columns if markers.weight[c] > 0)

    def columns(self, case: Case) -> Array:
        """Return the change of the wrench with the posture that the marker at its true place gives, per metre; zero
        without the marker.
        """
        own = self._own(case)
        return np.zeros((case.motion.time.size, 6, 3)) if own is None else case.geometry.marker_changes.wrench[..., own]

    def marker_columns(self, case: Case) -> Array:
        """Return what the model with the wrong place leaves of the markers, per metre; zero without the marker."""
        own = self._own(case)
        return (
            np.zeros((len(case.marker_columns), 3, 3))
            if own is None
            else -case.geometry.marker_changes.residual[..., own]
        )

    def corrected(self, case: Case, theta: Array) -> Case:
        """Return the trial tracked again with the marker at its true place."""
        body = move_marker(case.body, self.target, theta)
        return replace(case, body=body, motion=track(body, case.trial))

    def _own(self, case: Case) -> slice | None:
        """Return the columns of this marker in ``Geometry.marker_changes``; None where the trial does not have it."""
        index = case.body.markers.names.index(self.target)
        if index not in case.marker_columns:
            return None
        first = 3 * case.marker_columns.index(index)
        return slice(first, first + 3)


EFFECT = MarkerMisplaced
