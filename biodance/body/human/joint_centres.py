"""Joint centres from landmarks: points (3,) m in the lab frame in, points out. Every formula with its source.

Landmarks are marker CENTRES; a marker centre lies one marker radius outside the skin.
"""

import numpy as np

from biodance.records import Array

_MM = 1e-3


def unit(vector: Array) -> Array:
    """Return the vector (3,) with length 1."""
    return np.asarray(vector / np.linalg.norm(vector))


def pelvis_frame(right_asis: Array, left_asis: Array, mid_psis: Array) -> tuple[Array, Array]:
    """Return lab_R_pelvis (3, 3) and the middle of the ASIS (3,) m: z to the right ASIS, x forwards in the plane of
    ASIS and PSIS (ISB).
    """
    middle = (right_asis + left_asis) / 2
    z = unit(right_asis - left_asis)
    y = unit(np.cross(z, middle - mid_psis))
    return np.stack([np.cross(y, z), y, z], axis=1), middle


def davis_hip(pelvis_width: float, leg_length: float, asis_to_trochanter: float, marker_radius: float) -> Array:
    """Return the RIGHT hip centre (3,) m from the middle of the ASIS in the pelvis frame (left: z negated).

    Davis et al. 1991, doi:10.1016/0167-9457(91)90046-Z, as in Vicon plug-in gait: C = 0.115 leg - 15.3 mm, theta = 0.5
    rad, beta = 0.314 rad. ``leg_length`` is the mean of both legs, ``asis_to_trochanter`` (0.1288 leg - 48.56 mm) of
    this side; all m.
    """
    theta, beta = 0.5, 0.314
    c, depth = 0.115 * leg_length - 15.3 * _MM, asis_to_trochanter + marker_radius
    forward = c * np.cos(theta) * np.sin(beta) - depth * np.cos(beta)
    up = -c * np.cos(theta) * np.cos(beta) - depth * np.sin(beta)
    return np.array([forward, up, pelvis_width / 2 - c * np.sin(theta)])


def harrington_hip(pelvis_width: float, pelvis_depth: float) -> Array:
    """Return the RIGHT hip centre (3,) m from the middle of the ASIS in the pelvis frame (left: z negated).

    Harrington et al. 2007, doi:10.1016/j.jbiomech.2006.02.003, the regressions on inter-ASIS width and depth (mid ASIS
    to mid PSIS), m.
    """
    return np.array(
        [-0.24 * pelvis_depth - 9.9 * _MM, -0.30 * pelvis_width - 10.9 * _MM, 0.33 * pelvis_width + 7.3 * _MM]
    )


def chord(proximal: Array, marker: Array, distance: float, away_from: Array) -> Array:
    """Return the joint centre (3,) m at ``distance`` m from a lateral marker, with a right angle between marker and
    proximal centre.

    It lies in the plane of the proximal centre, the marker and the point ``away_from`` (a wand marker), on the side
    away from that point (Kadaba et al. 1990, doi:10.1002/jor.1100080310; plug-in gait). ``distance`` = (joint width +
    marker diameter) / 2.
    """
    arm = proximal - marker
    reach = float(np.linalg.norm(arm))
    along = arm / reach
    side = unit(np.cross(np.cross(along, away_from - marker), along))
    cosine = min(distance / reach, 1.0)
    return np.asarray(marker + distance * (cosine * along - np.sqrt(1 - cosine**2) * side))


def shoulder(trunk_origin: Array, forward: Array, acromion: Array, offset: float, *, side: float) -> Array:
    """Return the shoulder centre (3,) m under the acromion marker: chord from the trunk's origin, in the plane that is
    square to the trunk.

    ``forward`` (3,) is the trunk's unit x axis in the lab frame, ``offset`` m marker centre to joint centre, ``side``
    +1 right, -1 left.
    """
    up = side * np.cross(unit(acromion - trunk_origin), forward)
    return chord(trunk_origin, acromion, offset, acromion + up)


def elbow(shoulder_centre: Array, lateral: Array, mid_wrist: Array, distance: float, *, side: float) -> Array:
    """Return the elbow centre (3,) m from the lateral epicondyle alone: its axis is square to the plane of shoulder,
    marker and wrist.

    As in plug-in gait; wrong by centimetres where the arm hangs straight. With a medial marker use the middle instead.
    """
    normal = side * np.cross(mid_wrist - lateral, shoulder_centre - lateral)
    return chord(shoulder_centre, lateral, distance, lateral + unit(normal))


def wrist(elbow_centre: Array, radial: Array, ulnar: Array, distance: float, *, side: float) -> Array:
    """Return the wrist centre (3,) m under a wrist bar on the back of the wrist: square to the bar and to the
    forearm (plug-in gait).
    """
    middle = (radial + ulnar) / 2
    back = side * np.cross(radial - ulnar, elbow_centre - middle)
    return np.asarray(middle - distance * unit(back))
