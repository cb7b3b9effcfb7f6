"""A person who stands and wears markers under any labels."""

import numpy as np

from biodance.body.human.human import human
from biodance.lab.markers.sets import read_marker_set
from biodance.motion.kinematics import poses
from biodance.records import Markers, Subject

PERSON = Subject(62.0, 1.70, "F", name="S01")


def stand(names: dict[str, str], *, flip: bool = False) -> Markers:
    """Return a generic person standing for 3 frames, landmark -> label; ``flip`` gives every label to the other
    side.
    """
    body = human(PERSON)
    pose = poses(body, body.neutral)
    place = pose.points(body.markers.segment, body.markers.position)[0] + [0.0, 0.0, 0.96]
    pig = read_marker_set("plug_in_gait").landmarks
    points = []
    for landmark in names:
        other = {"right": "left", "left": "right"}.get(landmark.split("_")[0])
        wanted = f"{other}_{landmark.split('_', 1)[1]}" if flip and other else landmark
        points.append(np.mean([place[body.markers.names.index(label)] for label in pig[wanted][0]], axis=0))
    return Markers(tuple(names.values()), np.arange(3) / 100, np.tile(points, (3, 1, 1)))


SIDED = {"asis": "Waist_Front", "psis": "Waist_Back", "knee_lateral": "Outer_Knee", "heel": "HeelBack"} | {
    "ankle_lateral": "Outer_Malleolus",
    "toe": "Met2",
    "acromion": "Acromion",
}

OWN = {f"{side}_{place}": f"{name} {side[0].upper()}" for place, name in SIDED.items() for side in ("right", "left")}
