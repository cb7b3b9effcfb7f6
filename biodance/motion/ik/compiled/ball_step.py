"""A step of one ball joint, compiled: turn it by a rotation vector and keep its Cardan angles within their limits
(see ``ball``).
"""

import numpy as np

from biodance.motion.ik.compiled import compiled

_TURN = 2 * np.pi

_SMALL = 0.02
"""rad, step below which the angles follow to first order: Newton's next step corrects the rest, and it costs a fifth
of the exact turn.
"""

_UPRIGHT = 0.3  # Cosine of the second angle above which the angles are a good measure of the rotation


EQUAL_ANGLES = 1e-6  # rad: angles that differ by less are equal; which is larger may be rounding


@compiled
def _quaternion_of(sign, one, two, three):
    """Return the quaternion x, y, z, w of Cardan angles, rad."""
    h1, h2, h3 = 0.5 * sign * one, 0.5 * sign * two, 0.5 * sign * three
    s1, s2, s3, c1, c2, c3 = np.sin(h1), np.sin(h2), np.sin(h3), np.cos(h1), np.cos(h2), np.cos(h3)
    c23, s23, sc, cs = c2 * c3, s2 * s3, s2 * c3, c2 * s3
    return s1 * c23 + c1 * s23, c1 * sc - s1 * cs, c1 * cs + s1 * sc, c1 * c23 - s1 * s23


@compiled
def product(a, b):
    """Return the product of two quaternions: the rotation b, then a."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


@compiled
def exponential(x, y, z):
    """Return the quaternion of a rotation vector, rad."""
    half = 0.5 * np.sqrt(x * x + y * y + z * z)
    share = 0.5 * np.sin(half) / half if half > 1e-12 else 0.5
    return share * x, share * y, share * z, np.cos(half)


@compiled
def _near_to(angle, middle):
    """Return ``angle`` plus full turns, within half a turn of ``middle``."""
    # floor(x + 1/2): the number of full turns nearest to the difference.
    return angle - _TURN * np.floor((angle - middle) / _TURN + 0.5)


@compiled
def _middle_of(lower, upper, near):
    """Return the middle of a range narrower than a full turn, else ``near``."""
    return 0.5 * (lower + upper) if upper - lower < _TURN else near


@compiled
def beyond(angle, lower, upper):
    """Return how far an angle is outside its limits."""
    return max(lower - angle, angle - upper, 0.0)


@compiled
def _angles_of(quaternion, sign, near, lower, upper, out):
    """Fill ``out`` (3,) with the Cardan angles less outside the limits, or if alike, closer to ``near``."""
    x, y, z, w = quaternion
    a = sign * np.arctan2(2 * (x * w - y * z), 1 - 2 * (x * x + y * y))
    b = sign * np.arcsin(min(max(2 * (x * z + y * w), -1.0), 1.0))
    c = sign * np.arctan2(2 * (z * w - x * y), 1 - 2 * (y * y + z * z))
    m0, m1, m2 = (
        _middle_of(lower[0], upper[0], near[0]),
        _middle_of(lower[1], upper[1], near[1]),
        _middle_of(lower[2], upper[2], near[2]),
    )
    half = sign * np.pi
    a0, b0, c0 = _near_to(a, m0), _near_to(b, m1), _near_to(c, m2)
    a1, b1, c1 = _near_to(half + a, m0), _near_to(half - b, m1), _near_to(half + c, m2)
    outside = beyond(a0, lower[0], upper[0]) + beyond(b0, lower[1], upper[1]) + beyond(c0, lower[2], upper[2])
    other = beyond(a1, lower[0], upper[0]) + beyond(b1, lower[1], upper[1]) + beyond(c1, lower[2], upper[2])
    away = abs(a0 - near[0]) + abs(b0 - near[1]) + abs(c0 - near[2])
    away_other = abs(a1 - near[0]) + abs(b1 - near[1]) + abs(c1 - near[2])
    if other < outside - EQUAL_ANGLES or (other < outside + EQUAL_ANGLES and away_other < away):
        out[0], out[1], out[2] = a1, b1, c1
    else:
        out[0], out[1], out[2] = a0, b0, c0


@compiled
def hold(rotation, sign, k, lower, upper, out):
    """Fill ``out`` (3,) with the angles inside the limits that come nearest to ``rotation`` with angle ``k`` held at
    its limit.

    The overlap of two unit quaternions is bilinear in the half angles' (cos, sin) of the two angles that remain: E, F,
    G, H below are the half sums and differences of its four coefficients, and its maximum is where both cosines of sum
    and difference are largest.
    """
    one, two = (k + 1) % 3, (k + 2) % 3
    if one > two:
        one, two = two, one
    angles, overlap = np.zeros(3), np.empty(4)
    angles[k] = min(max(out[k], lower[k]), upper[k])
    # Angles 0 or pi have half angles 0 or pi / 2: each corner is one coefficient of the bilinear form.
    for corner in range(4):
        angles[one], angles[two] = (np.pi if corner >= 2 else 0.0), (np.pi if corner % 2 else 0.0)
        x, y, z, w = _quaternion_of(sign, angles[0], angles[1], angles[2])
        overlap[corner] = x * rotation[0] + y * rotation[1] + z * rotation[2] + w * rotation[3]
    # The sum of the half angles and their difference maximise one cosine each.
    total = np.arctan2(overlap[2] + overlap[1], overlap[0] - overlap[3])
    apart = np.arctan2(overlap[2] - overlap[1], overlap[0] + overlap[3])
    out[k] = angles[k]
    for i, angle in ((one, total + apart), (two, total - apart)):
        out[i] = min(max(_near_to(angle, _middle_of(lower[i], upper[i], out[i])), lower[i]), upper[i])


@compiled
def turned(angles, step, sign, lower, upper, out):
    """Fill ``out`` (3,) with the ``angles`` (3,) after a turn by ``step`` (3,) rad, within the limits; return whether
    one was met.

    The rotation vector is written along the three axes in the frame of the first joint, after its angle.
    """
    # Cosine of the second angle: axes 1 and 3 are parallel where it is zero.
    tilt = np.cos(angles[1])
    if tilt > _UPRIGHT and step[0] * step[0] + step[1] * step[1] + step[2] * step[2] < _SMALL * _SMALL:
        out[1], out[2] = angles[1] + step[1], angles[2] + step[2] / tilt
        out[0] = angles[0] + step[0] - sign * np.sin(angles[1]) * step[2] / tilt
        if (
            beyond(out[0], lower[0], upper[0]) + beyond(out[1], lower[1], upper[1]) + beyond(out[2], lower[2], upper[2])
            == 0
        ):
            return False
    # The step from the frame after the first angle to that before it.
    sine, cosine = np.sin(sign * angles[0]), np.cos(sign * angles[0])
    still = exponential(
        sign * step[0], sign * (cosine * step[1] - sine * step[2]), sign * (sine * step[1] + cosine * step[2])
    )
    rotation = product(still, _quaternion_of(sign, angles[0], angles[1], angles[2]))
    _angles_of(rotation, sign, angles, lower, upper, out)
    worst, which = 0.0, -1
    for k in range(3):
        outside = beyond(out[k], lower[k], upper[k])
        if outside > worst:
            worst, which = outside, k
    if which >= 0:
        hold(rotation, sign, which, lower, upper, out)
    return (out <= lower).any() or (out >= upper).any()


@compiled
def continue_angles(chain, q):
    """Give each ball joint of consecutive postures q (T, nq) within the limits that of its two equal sets of Cardan
    angles which goes on from the frame before (the first one from zero).

    Both sets are one rotation and fit the markers alike, so that which one a frame's own search ends at is rounding. A
    set outside the limits is not taken; of two equally near ones that with the second angle within a quarter turn.
    """
    first = q.shape[1] - chain.parent.shape[0]
    before, other = np.empty(3), np.empty(3)
    for b in range(chain.ball.shape[0]):
        j = chain.ball[b]
        before[:] = 0.0
        for t in range(q.shape[0]):
            own, nearer, inside = q[t, first + j : first + j + 3], 0.0, True
            for k in range(3):
                lower, upper = chain.lower[j + k], chain.upper[j + k]
                turned_over = np.pi - own[k] if k == 1 else np.pi + own[k]
                other[k] = _near_to(turned_over, _middle_of(lower, upper, before[k]))
                inside = inside and beyond(other[k], lower, upper) == 0
                nearer += abs(own[k] - before[k]) - abs(other[k] - before[k])
            if inside and (nearer > EQUAL_ANGLES or (nearer > -EQUAL_ANGLES and np.cos(own[1]) < 0)):
                own[:] = other
            before[:] = own
