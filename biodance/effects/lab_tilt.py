"""The laboratory's vertical, as the cameras were calibrated, is not gravity's."""

import numpy as np

from biodance.effects._base.case import Case
from biodance.effects._base.effect import Effect, Parameter
from biodance.effects._base.words import ACCEPT, About, CauseWords, CheckKind
from biodance.records import Array


class LabTilt(Effect):
    """An ``angle`` (rad) about lab axis ``target`` ("x" or "y") by which gravity is turned in the lab frame."""

    name = "lab_tilt"
    parameters = (
        Parameter(
            "angle",
            "rad",
            0.005,
            "0.1-1 deg after an L-frame calibration on an uneven floor",
            # rad that matters: laboratories that check have 2 to 5 mm and 0.2 degrees (Collins
            # 2009, doi:10.1016/j.gaitpost.2008.10.060).
            least=0.005,
        ),
    )
    separated_by = "Squats: the centre of mass changes its height, an offset does not."
    advice = "Hang a plumb line with two markers; set the cameras' vertical by it."
    about = About(
        what="The laboratory's vertical, as the cameras were calibrated, is not gravity's.",
        signature=(
            "A constant horizontal force of body weight times the tilt, and its moment, which follows the height of "
            "the centre of mass."
        ),
        look_alikes="Offset of Fx with My, or Fy with Mx; pitch or roll of the plate.",
        settled_by="Squats (the centre of mass changes height) and by a plumb line with two markers.",
    )
    words = CauseWords(
        "the laboratory is tilted {size}{between} about {it}", f"Calibrate the cameras{ACCEPT}", "a tilted floor"
    )
    explains = (CheckKind.PRESSURE,)

    @classmethod
    def targets(cls, case: Case) -> tuple[str, ...]:
        """Return the two horizontal axes."""
        return ("x", "y")

    def columns(self, case: Case) -> Array:
        """Return the change of the predicted wrench per radian: the weight turns by axis x gravity, and its moment
        with it.
        """
        # Gravity turned by a small angle about the axis: g + axis x g.
        turned = np.cross(np.eye(3)["xyz".index(self.target)], case.body.gravity)
        table = case.body.link_parameters(case.phi).reshape(-1, 10)
        move = case.segments
        # sum over segments n of R h + m p: first moment about the lab origin.
        first = np.einsum("tnij,nj->ti", move.rotation, table[:, 1:4]) + np.einsum(
            "tni,n->ti", move.position, table[:, 0]
        )
        force = np.tile(-table[:, 0].sum() * turned, (len(first), 1))
        # Needed force -m g, its moment first x (-g): both with the turned part of gravity.
        return np.concatenate([force, np.cross(first, -turned)], axis=1)[:, :, None]


EFFECT = LabTilt
