"""The parts of a person that carry no markers: they stand by proportion where a person's parts are, upright with
hanging arms, and are carried as one piece with what is seen.

Clinics mark legs and pelvis, often the trunk, seldom the arms. What is not seen has no motion of its own here: its mass
is right, its movement is not known, and every page says so.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from biodance.body.body import Body
from biodance.body.human.measures import harrington_hip, pelvis_frame, unit
from biodance.body.human.standing import StaticPosture
from biodance.body.human.static_centres import SIGN, UP
from biodance.body.tables.error_sizes import error_size
from biodance.lab.markers.sets import usual_places
from biodance.records import SIDES, Array

_THORAX = ("c7", "jugular_notch", "t10", "xiphoid")
_ARM = ("upper_arm", "forearm_hand")
ARM_JOINTS = {side: (f"{side}_shoulder", f"{side}_elbow") for side in SIDES}
"""The anatomical joints of an arm, held where it is not seen."""


@dataclass(frozen=True, eq=False)
class _Upright:
    """The upright frame over a standing pelvis: ``middle`` (3,) m between the hips, unit vectors ``ahead`` and
    ``right``; ``sizes`` m by normaliser of the marker sets.
    """

    middle: Array
    ahead: Array
    right: Array
    sizes: Mapping[str, float]

    def turned(self, offset: Array) -> Array:
        """Return an offset (anterior, up, right) m in the lab frame."""
        return np.asarray(offset[0] * self.ahead + offset[1] * UP + offset[2] * self.right)

    def usual(self, landmark: str) -> Array:
        """Return the usual place (3,) m of a landmark from the origin of its offset, lab frame."""
        marker = usual_places()[landmark]
        return self.turned(np.array(marker.offset) * self.sizes[marker.normaliser])


def with_unseen_parts(posture: StaticPosture, lengths: Mapping[str, float]) -> StaticPosture:
    """Return the posture with the landmarks of shoulders and arms that have no marker, put where they usually are.

    ``lengths`` m by kind of segment, of the person's table at their stature. ``unseen`` names the joints that are then
    held, ``notes`` what that costs.
    """
    mark = dict(posture.landmarks)
    upright = _upright(mark, lengths)
    unseen, notes = _trunk(mark, upright)
    hidden: list[str] = []
    for side in SIDES:
        hidden += _arm(mark, upright, side)
    segments = {f"{side}_{part}" for side in hidden for part in _ARM}
    worn = {marker.label for marker in posture.marker_set.markers if marker.segment in segments}
    points = {label: place for label, place in posture.points.items() if label not in worn}
    unseen += [joint for side in hidden for joint in ARM_JOINTS[side]]
    if hidden:
        notes.append(
            f"The {' and '.join(hidden)} arm{'s carry' if len(hidden) > 1 else ' carries'} no markers that "
            "place elbow and wrist: taken as hanging straight and carried by the trunk as one piece, at the mass of "
            "the table. How arms swing is not in the simulated wrench."
        )
    return replace(posture, points=points, landmarks=mark, unseen=tuple(unseen), notes=(*posture.notes, *notes))


def widen_unseen(body: Body, unseen: tuple[str, ...]) -> Body:
    """Return the body with wider standard deviations of where the mass of its unseen parts is: a posture that nobody
    saw shifts the centre of mass.
    """
    sizes = {f"{side}_{part}": "arm" for side in SIDES for part in _ARM if f"{side}_elbow" in unseen}
    sizes |= {"trunk_head": "trunk_head"} if "trunk" in unseen else {}
    if not sizes:
        return body
    covariance = np.array(body.sip.covariance)
    for segment, kind in sizes.items():
        k = body.segments.index(segment)
        moments = np.arange(10 * k + 1, 10 * k + 4)
        covariance[moments, moments] += (body.sip.mass[k] * error_size("unseen_com", kind)) ** 2
    return replace(body, sip=replace(body.sip, covariance=covariance))


def _upright(mark: Mapping[str, Array], lengths: Mapping[str, float]) -> _Upright:
    rotation, middle = pelvis_frame(mark["right_asis"], mark["left_asis"], mark["mid_psis"])
    width = float(np.linalg.norm(mark["right_asis"] - mark["left_asis"]))
    local = harrington_hip(width, float(np.linalg.norm(middle - mark["mid_psis"])))
    right = unit(rotation[:, 2] * [1.0, 1.0, 0.0])
    sizes = {f"{kind.removesuffix('_hand')}_length": lengths[kind] for kind in _ARM}
    sizes["trunk_length"] = lengths["trunk_head"]
    return _Upright(middle + rotation @ (local * [1.0, 1.0, 0.0]), np.cross(UP, right), right, sizes)


def _trunk(mark: dict[str, Array], upright: _Upright) -> tuple[list[str], list[str]]:
    """Put the acromia that are not seen; return whether the trunk's joint is held, and what that costs."""
    absent = [side for side in SIDES if f"{side}_acromion" not in mark]
    if not absent:
        return [], []
    if len(absent) == 1 and "jugular_notch" in mark:
        seen = next(side for side in SIDES if side not in absent)
        across = 2 * ((mark[f"{seen}_acromion"] - mark["jugular_notch"]) @ upright.right) * upright.right
        mark[f"{absent[0]}_acromion"] = mark[f"{seen}_acromion"] - across
        return [], [f"The {absent[0]} acromion has no marker: taken as the mirror image of the other."]
    thorax = [name for name in _THORAX if name in mark]
    shoulders = upright.middle + upright.sizes["trunk_length"] * UP
    if thorax:
        shoulders = np.mean([mark[name] - upright.usual(name) for name in thorax], axis=0)
    for side in absent:
        mark[f"{side}_acromion"] = shoulders + upright.usual(f"{side}_acromion")
    if len(thorax) >= 3:
        return [], [f"The acromia have no markers: shoulders placed by proportion from {', '.join(thorax)}."]
    return ["trunk"], [
        "The trunk carries too few markers to be followed: trunk, head and arms are one piece of the table's "
        "size and mass that stays upright over the pelvis and faces where it goes. How they really lean and turn is "
        "not in the simulated wrench, so horizontal forces and moments prove little."
    ]


def _arm(mark: dict[str, Array], upright: _Upright, side: str) -> list[str]:
    """Put the landmarks of an arm that is not seen, hanging straight; return the side if it is not seen."""
    radial, ulnar = f"{side}_wrist_radial", f"{side}_wrist_ulnar"
    wrist = [mark[name] for name in (radial, ulnar) if name in mark]
    if f"{side}_elbow_lateral" in mark and wrist:
        mark |= {radial: mark.get(radial, wrist[0]), ulnar: mark.get(ulnar, wrist[0])}
        return []
    out = SIGN[side] * upright.right
    under = upright.usual(f"{side}_acromion") @ UP
    elbow = mark[f"{side}_acromion"] - under * UP - upright.sizes["upper_arm_length"] * UP
    half = 0.15 * upright.sizes["upper_arm_length"]
    for name, height, across in (
        ("elbow_lateral", 0.0, half),
        ("elbow_medial", 0.0, -half),
        ("wrist_radial", upright.sizes["forearm_length"], half / 2),
        ("wrist_ulnar", upright.sizes["forearm_length"], -half / 2),
    ):
        mark[f"{side}_{name}"] = elbow - height * UP + across * out
    return [side]
