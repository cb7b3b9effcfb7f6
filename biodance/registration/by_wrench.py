"""The pose from the wrench that the whole body needs: least squares on its spectrum, with the body's parameters, soft
tissue, joints and the plates' own tolerances free within what is known of them.

Measured minus needed wrench, y = A x + X u + noise, with A the columns of the pose and X u all that is no fault (the
problem of the diagnosis); with C the covariance of X u + noise, x has the covariance (A' C^-1 A)^-1.
"""

from dataclasses import replace

import numpy as np

from biodance.body.body import Body
from biodance.diagnosis.candidates import candidates
from biodance.diagnosis.model import model
from biodance.diagnosis.problem import Look, problem
from biodance.effects import Case
from biodance.records import Array
from biodance.registration.pull import PoseEvidence
from biodance.spatial import cross, wrench_about_origin, wrench_about_point
from biodance.uncertainty.tolerances import Tolerances

_SOUGHT = ("plate_position x", "plate_position y", "plate_rotation z", "time_delay")
"""Tolerances of an installed plate that are no tolerances here: they are what is looked for."""
_SHORTEST = 0.25
"""s: of walks over two plates no more than 0.3 to 0.9 s are fully measured."""
_UNKNOWN = np.array([0.1, 0.1, np.radians(5.0), 0.05])
"""m, m, rad, s: how far a first alignment can be off; keeps a direction that nothing shows from running away."""


def wrench_pull(body: Body, look: Look, tolerances: Tolerances, about: Array) -> PoseEvidence:
    """Return what the wrench of one trial, placed by the pose so far, says of a change of that pose about ``about``
    (3,) m.

    Raises
    ------
    TrialRefused
        No quarter of a second is fully measured and believable.
    """
    known = replace(tolerances, sizes={key: size for key, size in tolerances.sizes.items() if key not in _SOUGHT})
    put = problem(body, (look,), shortest=_SHORTEST)
    found = model(put, candidates(put), known)
    rows = put.spectrum.rows((_columns(put.cases[0], about),)).reshape(-1, 4)
    rows = np.concatenate([rows, np.zeros((len(put.target) - len(rows), 4))])
    vector, information = found.belief.score(found.white(rows))
    return PoseEvidence(
        information + np.diag(_UNKNOWN**-2.0),
        -vector,
        float(found.belief.left @ found.belief.left) / len(found.belief.y),
        put.wrench_rows,
    )


def _columns(case: Case, about: Array) -> Array:
    """Return (T, 6, 4): what one unit of x, y, yaw and delay adds to the measured wrench about the room's origin."""
    wrench = case.trial.wrench.value
    force, up = wrench[:, :3], np.array([[0.0, 0.0, 1.0]])
    out = np.zeros((len(wrench), 6, 4))
    out[:, 3:, 0] = cross(np.array([[1.0, 0.0, 0.0]]), force)
    out[:, 3:, 1] = cross(np.array([[0.0, 1.0, 0.0]]), force)
    near = wrench_about_point(wrench, about)
    turned = np.concatenate([cross(up, near[:, :3]), cross(up, near[:, 3:])], axis=1)
    out[:, :, 2] = wrench_about_origin(turned, about)
    out[:, :, 3] = np.gradient(wrench, case.motion.time, axis=0)
    return out
