"""Postures between known postures: monotone cubics in the coordinates of ``chart`` (Fritsch & Butland 1984, DOI
10.1137/0905021).
"""

import numpy as np

from biodance.motion.ik.compiled import compiled
from biodance.motion.ik.compiled.ball_step import angles_of


@compiled
def slope_at(before, at, after, one, two):
    """Return the slope in the middle of three values ``one`` and ``two`` frames apart: zero at a turn, else a
    weighted harmonic mean.
    """
    left, right = (at - before) / one, (after - at) / two
    if left * right <= 0:
        return 0.0
    first, second = 2 * two + one, two + 2 * one
    return (first + second) / (first / left + second / right)


@compiled
def smooth_at(known, values, k, frame, out):
    """Fill ``out`` (C,) with the cubic through ``values`` (M, C) at ``frame`` between the ``known`` frames k and k +
    1.
    """
    last, width = known.shape[0] - 1, float(known[k + 1] - known[k])
    share = (frame - known[k]) / width
    h0, h1 = (1 + 2 * share) * (1 - share) ** 2, share * share * (3 - 2 * share)
    d0, d1 = width * share * (1 - share) ** 2, -width * share * share * (1 - share)
    for c in range(values.shape[1]):
        one, two = values[k, c], values[k + 1, c]
        start = end = (two - one) / width
        if k > 0:
            start = slope_at(values[k - 1, c], one, two, known[k] - known[k - 1], width)
        if k + 1 < last:
            end = slope_at(one, two, values[k + 2, c], width, known[k + 2] - known[k + 1])
        out[c] = h0 * one + h1 * two + d0 * start + d1 * end


@compiled
def posture_of(chain, smooth, near, single, q):
    """Fill q (nq,) from ``smooth`` coordinates (see ``chart``); ``near`` (nq,) decides between equal sets of Cardan
    angles.
    """
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
        over, j = 1 / np.sqrt(x * x + y * y + z * z + w * w), chain.ball[b]
        turn = (x * over, y * over, z * over, w * over)
        place = slice(first + j, first + j + 3)
        angles_of(turn, chain.sign[b], near[place], chain.lower[j : j + 3], chain.upper[j : j + 3], q[place])
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
        posture_of(chain, smooth, nearest, single, out[f])
