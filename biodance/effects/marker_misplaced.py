"""A marker does not sit where the static trial put it: it was knocked, re-glued, or slid with a strap."""

from dataclasses import replace

import numpy as np

from biodance.body.changes import move_marker
from biodance.body.tables.error_sizes import error_size
from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter
from biodance.effects._base.words import About, CauseWords, CheckKind
from biodance.errors import TrialRefused
from biodance.motion.ik.inverse_kinematics import solve_ik
from biodance.motion.kinematics import neighbours, poses
from biodance.motion.track import track
from biodance.records import Array, Markers


class MarkerMisplaced(Effect):
    """A ``shift`` (x, y, z: m, axes of its segment) from where the model has the marker ``target`` to where it sits."""

    name = "marker_misplaced"
    prior = 0.02
    parameters = tuple(
        Parameter(
            f"shift_{axis}",
            "m",
            0.010,
            "up to 20-30 mm between examiners (Osis 2016, PLoS ONE 0147111)",
            # m that matter: who places markers twice places them 4 to 6 mm apart (Della Croce
            # 1999, doi:10.1007/BF02513272); one marker among forty is twice as far off in every
            # careful laboratory.
            least=0.01,
            usual=error_size("soft_tissue", "marker"),
        )
        for axis in "xyz"
    )
    taken_up_by_calibration = True
    each_its_own = True
    separated_by = "A second static trial at the end of the session shows where the marker sits now."
    advice = "Look at the marker on the video; record another static trial and scale the body on it."
    about = About(
        what="A marker does not sit where the static trial put it: it was knocked, re-glued, or slid with a strap.",
        signature=(
            "The mean residual of this marker and, with opposite sign, of the others on its segment; the segment "
            "turns a little, and the wrench with it."
        ),
        look_alikes="A wrong centre of a joint of the same segment; a soft spot under the marker.",
        settled_by=(
            "More markers on the segment and by a second static trial at the end. A marker that was wrong in the "
            "static trial, too, is a wrong joint centre."
        ),
    )
    words = CauseWords(
        "marker {it} sits {size}{between} from its place", "Put it back, or leave it out.", "a moved marker"
    )
    explains = (CheckKind.PRESSURE, CheckKind.MARKERS)

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
        if own is None:
            return np.zeros((case.motion.time.size, 6, 3))
        return np.asarray(case.geometry.marker_changes.wrench[..., own], dtype=float)

    def marker_columns(self, case: Case) -> Array:
        """Return what the model with the wrong place leaves of the markers, per metre; zero without the marker."""
        own = self._own(case)
        return (
            np.zeros((len(case.marker_columns), 3, 3))
            if own is None
            else -case.geometry.marker_changes.residual[..., own]
        )

    @property
    def unlike(self) -> float:
        """How far the wrench of a posture that a marker pulls along is from its derivative; learned where sizes were
        inferred from all rows (docs/decisions/2026-11-21-detection-limits.md).
        """
        return 0.46

    def measured(self, theta: Array, *cases: Case) -> Array:
        """Return the place (3,) m of the marker beside the one in the model, upright, over postures tracked without it:
        a posture that follows the marker hides half of how far it has moved. What goes with the joints beside its
        segment is skin that slides over bone, and no marker that has moved.
        """
        found = [one for one in map(self._beside, cases) if one is not None]
        if not found:
            return theta
        apart, angles = map(np.concatenate, zip(*found, strict=True))
        # Angles in units of skin's own standard deviation: slide per radian over soft tissue.
        slides = error_size("slide", "marker") / error_size("soft_tissue", "marker") * angles
        inner = np.eye(len(apart)) + slides @ slides.T  # covariance of one axis beside its place, per skin's variance
        # Generalised least squares of a constant: 1'C^-1 x / 1'C^-1 1.
        weight = np.linalg.solve(inner, np.ones(len(apart)))
        return np.asarray(weight @ apart / weight.sum()) if len(apart) else theta

    def _beside(self, case: Case) -> tuple[Array, Array] | None:
        """Return (F, 3) m, axes of its segment: where the marker lies beside its place in the model, once a second
        where it is seen, in postures that do not follow it, and the angles (F, n) beside its segment there; None where
        it is not there or the others determine no posture.
        """
        markers, body = case.trial.markers, case.body
        if markers is None or self.target not in markers:
            return None
        every = slice(None, None, max(1, round(case.motion.rate)))
        names = [name for name in markers.names if name != self.target]
        others = Markers(tuple(names), markers.time[every], markers.select(names).xyz[every])
        try:
            q = solve_ik(body, others, guess=case.motion.q[every]).q
        except TrialRefused:
            return None
        pose, index = poses(body, q), body.markers.names.index(self.target)
        segment = body.markers.segment[index]
        apart = markers[self.target][every] - pose.points([segment], body.markers.position[[index]])[:, 0]
        # Segment axes: R' d.
        local = np.einsum("tij,ti->tj", pose.rotation[:, segment], apart)
        seen = np.isfinite(local).all(axis=1)
        return local[seen], q[seen, 7 if body.n_root else 0 :][:, neighbours(body)[:, segment] > 0]

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
