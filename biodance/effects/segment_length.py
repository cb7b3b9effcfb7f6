"""A segment is longer than the model's."""

from dataclasses import replace

import numpy as np

from biodance.body.changes import move_joint
from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter
from biodance.effects._base.geometry import joint_chains
from biodance.effects._base.words import About, CauseWords, CheckKind
from biodance.motion.track import track
from biodance.records import Array


class SegmentLength(Effect):
    """An ``error`` (m): segment ``target`` is this much longer, from its near to its far joint, than in the model."""

    name = "segment_length"
    parameters = (
        Parameter(
            "error",
            "m",
            0.010,
            "3-20 mm between typed measures and markers (public recordings: 16 mm at the hip)",
            # m that matter: who places markers twice places them 4 to 6 mm apart (Della Croce
            # 1999, doi:10.1007/BF02513272).
            least=0.005,
        ),
    )
    taken_up_by_calibration = True
    separated_by = "Deep squats for the legs, full flexion of the elbow for the arms."
    advice = (
        "Measure the bone with a calliper between its landmarks; record a new static trial in the shoes of the session."
    )
    about = About(
        what=(
            "A segment is longer than the model's: typed measures, a body scaled on another day, shoes that came or "
            "went since the static trial."
        ),
        signature=(
            "Everything beyond the segment's far joint lies farther out; the markers on both sides of the bone "
            "contradict each other by the same distance in every posture, and the moment follows the segment's "
            "direction."
        ),
        look_alikes="A joint centre shifted along the bone, markers misplaced along it.",
        settled_by="Deep squats (legs) and elbow flexion (arms), and by measuring the bone.",
    )
    words = CauseWords(
        "the {it} is {size} {more}{between} than its markers say",
        "Measure it.",
        "a wrong length",
        ("longer", "shorter"),
    )
    explains = (CheckKind.MARKERS,)

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return the segments between two joints; none without markers."""
        body, count = case.body, len(case.body.segments)
        chains = [chain for chain in joint_chains(body).values() if body.joints[chain[-1]].segment < count]
        inner = {body.place_on_segment(chain[0])[0] for chain in chains if body.joints[chain[0]].parent >= 0}
        carried = sorted(inner, key=body.segment_joint.__getitem__)
        return tuple(body.segments[s] for s in carried) if case.marker_columns else ()

    def columns(self, case: Case) -> Array:
        """Return the change of the wrench with the posture that the markers give the true body, per metre."""
        return case.geometry.joint_changes.wrench[..., self._own(case)].sum(axis=2, dtype=float, keepdims=True)

    def marker_columns(self, case: Case) -> Array:
        """Return what the model with the wrong length leaves of the markers, per metre."""
        return -case.geometry.joint_changes.residual[..., self._own(case)].sum(axis=2, keepdims=True)

    def corrected(self, case: Case, theta: Array) -> Case:
        """Return the trial tracked again with the longer body."""
        body = case.body
        for chain in self._far(case):
            # Along the bone: from the near joint's origin to the far joint.
            out = body.joints[chain[0]].translation
            body = move_joint(body, chain[0], float(theta[0]) * out / np.linalg.norm(out))
        return replace(case, body=body, motion=track(body, case.trial))

    def _far(self, case: Case) -> list[tuple[int, ...]]:
        """Return the joints at the far end."""
        own = case.body.segment_joint[case.body.segment_index(self.target)]
        return [chain for chain in joint_chains(case.body).values() if case.body.joints[chain[0]].parent == own]

    def _own(self, case: Case) -> list[int]:
        """Return the columns of the far joints in ``Geometry.joint_changes``."""
        far = self._far(case)
        # Column 3 of each joint is the segment longer towards it.
        return [4 * i + 3 for i, chain in enumerate(joint_chains(case.body).values()) if chain in far]


EFFECT = SegmentLength
