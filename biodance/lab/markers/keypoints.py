"""Joints that software estimated from video: a skeleton of joint centres is no set of markers on skin."""

from collections.abc import Iterable

from biodance.lab.markers.names import meanings_of, sided_words
from biodance.lab.markers.spelling import plain_labels
from biodance.records import SIDES

_JOINTS = ("hip", "knee", "ankle")
"""Joints whose bare names stand on both sides in every skeleton of video: HALPE, COCO, OpenPose, BlazePose."""
_SKIN = ("asis", "psis", "knee_medial", "ankle_medial")
"""Ends of landmarks that only a marker has: a trochanter may be called hip beside them."""
FROM_VIDEO = (
    "These labels are joints, as software estimates them from video, not markers on the skin: {named}. A body is "
    "placed by markers on both iliac spines, at the side of knees and ankles, on heels and toes. Give positions of "
    "markers, for example the augmented markers (.trc) of the same software."
)


def joints_from_video(labels: Iterable[str]) -> tuple[str, ...]:
    """Return the labels, without the subject's name, that name hips, knees and ankles by the bare name of the joint on
    both sides; none where any of the six is missing, or where others name a spine of the pelvis or a medial side.
    """
    labels = tuple(labels)
    said = sided_words(labels)
    if any(one.place.endswith(_SKIN) for ways in meanings_of(labels).values() for one in ways[:1]):
        return ()
    plain = plain_labels(labels)
    found = {said[label]: plain[label] for label in said if said[label][1] in _JOINTS}
    wanted = [(side, joint) for joint in _JOINTS for side in SIDES]
    return tuple(found[one] for one in wanted) if all(one in found for one in wanted) else ()
