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


_EQUAL = 1e-6  # rad: angles that differ by less are equal; which is larger may be rounding


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
    if other < outside - _EQUAL or (other < outside + _EQUAL and away_other < away):
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
            if inside and (nearer > _EQUAL or (nearer > -_EQUAL and np.cos(own[1]) < 0)):
                own[:] = other
            before[:] = own


# Postures between known postures: monotone cubics in the coordinates of ``chart`` (Fritsch & Butland 1984, DOI
# 10.1137/0905021).


@compiled
def _slope_at(before, at, after, one, two):
    """Return the slope in the middle of three values: zero at a turn, else a weighted harmonic mean."""
    left, right = (at - before) / one, (after - at) / two
    if left * right <= 0:
        return 0.0
    # Uneven intervals: the slope before has the weight 2 h_after + h_before.
    first, second = 2 * two + one, two + 2 * one
    return (first + second) / (first / left + second / right)


@compiled
def smooth_at(known, values, k, frame, out):
    """Fill ``out`` (C,) with the cubic through ``values`` (M, C) at ``frame`` between ``known`` k and k + 1."""
    last, width = known.shape[0] - 1, float(known[k + 1] - known[k])
    share = (frame - known[k]) / width
    # Hermite's basis: values, then slopes times the width.
    h0, h1 = (1 + 2 * share) * (1 - share) ** 2, share * share * (3 - 2 * share)
    d0, d1 = width * share * (1 - share) ** 2, -width * share * share * (1 - share)
    for c in range(values.shape[1]):
        one, two = values[k, c], values[k + 1, c]
        start = end = (two - one) / width
        if k > 0:
            start = _slope_at(values[k - 1, c], one, two, known[k] - known[k - 1], width)
        if k + 1 < last:
            end = _slope_at(one, two, values[k + 2, c], width, known[k + 2] - known[k + 1])
        out[c] = h0 * one + h1 * two + d0 * start + d1 * end


@compiled
def _posture_of(chain, smooth, near, single, q):
    """Fill q (nq,) from ``smooth`` coordinates; ``near`` (nq,) decides between equal sets of Cardan angles."""
    first, c = q.shape[0] - chain.parent.shape[0], 0
    if chain.roots:
        for c in range(3):
            q[c] = smooth[c]
        over = 1 / np.sqrt(smooth[3] ** 2 + smooth[4] ** 2 + smooth[5] ** 2 + smooth[6] ** 2)
        for c in range(3, 7):
            q[c] = smooth[c] * over
        c = 7
    groups = chain.ball.shape[0]
    for b in range(groups):
        x, y, z, w = smooth[c + b], smooth[c + groups + b], smooth[c + 2 * groups + b], smooth[c + 3 * groups + b]
        # Parts of a quaternion lie a number of balls apart: x of all, y of all ...
        over, j = 1 / np.sqrt(x * x + y * y + z * z + w * w), chain.ball[b]
        turn = (x * over, y * over, z * over, w * over)
        place = slice(first + j, first + j + 3)
        _angles_of(turn, chain.sign[b], near[place], chain.lower[j : j + 3], chain.upper[j : j + 3], q[place])
    for k in range(single.shape[0]):
        q[first + single[k]] = smooth[c + 4 * groups + k]


@compiled
def interpolate(chain, known, values, q, single, wanted, out):
    """Fill ``out`` (F, nq) with the postures at the frames ``wanted`` (F,) between the postures q (M, nq) at the frames
    ``known`` (M,).

    ``values`` (M, C) their smooth coordinates, ``single`` the joints outside ball joints. Beyond the known frames the
    nearest one stays.
    """
    smooth = np.empty(values.shape[1])
    for f in range(wanted.shape[0]):
        k = np.searchsorted(known, wanted[f], side="right") - 1
        if k < 0 or k >= known.shape[0] - 1:
            for c in range(q.shape[1]):  # not as a row: see `newton.minimise_frames`
                out[f, c] = q[max(k, 0), c]
            continue
        smooth_at(known, values, k, wanted[f], smooth)
        nearest = q[k] if wanted[f] - known[k] < known[k + 1] - wanted[f] else q[k + 1]
        _posture_of(chain, smooth, nearest, single, out[f])
