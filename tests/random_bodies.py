"""Random trees with known truth, for tests that must hold for any body, not only for the human."""

import numpy as np
from scipy.spatial.transform import Rotation

from biodance.body.body import Body
from biodance.body.parts import Joint, JointLimits, SegmentMarkers
from biodance.records import Motion, Sip


def random_sip(segments: tuple[str, ...], rng: np.random.Generator) -> Sip:
    """Return physically consistent parameters: each segment is a cloud of point masses."""
    phi = []
    for _ in segments:
        points, weights = rng.normal(0, 0.1, (8, 3)), rng.uniform(0.1, 1.0, 8)
        first = weights @ points
        inertia = sum(w * (p @ p * np.eye(3) - np.outer(p, p)) for w, p in zip(weights, points, strict=True))
        phi.append(
            [weights.sum(), *first, *(inertia[i, j] for i, j in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)))]
        )
    flat = np.concatenate(phi)
    return Sip(segments, flat, np.diag((0.1 * np.abs(flat)) ** 2))


def random_body(rng: np.random.Generator, *, n_segments: int = 6, root: str = "free_flyer") -> Body:
    """Return a random tree: 1 to 3 joints per segment, random axes and placements, 3 markers per segment."""
    segments = tuple(f"s{i}" for i in range(n_segments))
    joints: list[Joint] = []
    tip = {0: -1}
    first = 1 if root == "free_flyer" else 0
    for s in range(first, n_segments):
        parent = tip[int(rng.integers(0, s))] if s > 0 else -1
        dofs = int(rng.integers(1, 4))
        for k in range(dofs):
            axis = rng.normal(size=3)
            rotation = Rotation.random(rng=rng).as_matrix() if k == 0 else np.eye(3)
            translation = rng.normal(0, 0.3, 3) if k == 0 else np.zeros(3)
            carried = s if k == dofs - 1 else -1
            joints.append(Joint(f"j{s}{k}", parent, axis / np.linalg.norm(axis), rotation, translation, carried))
            parent = len(joints) - 1
        tip[s] = parent
    n, count = len(joints), 3 * n_segments
    one = np.ones(n)
    return Body(
        "random",
        segments,
        tuple(joints),
        random_sip(segments, rng),
        JointLimits(-2 * one, 2 * one, 4 * one, -99 * one, 99 * one),
        SegmentMarkers(
            tuple(f"m{i}" for i in range(count)),
            tuple(i // 3 for i in range(count)),
            rng.normal(0, 0.1, (count, 3)),
            np.ones(count),
        ),
        np.tile([[-1.0] * 3, [1.0] * 3], (n_segments, 1, 1)),
        np.tile([[-1.0] * 3, [1.0] * 3], (n_segments, 1, 1)),
        root=root,
    )


def random_motion(body: Body, rng: np.random.Generator, *, frames: int = 5) -> Motion:
    """Return unrelated random q, v, a (enough for identities that hold at every instant)."""
    q = rng.normal(size=(frames, body.nq))
    if body.n_root:
        q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    return Motion(np.arange(frames) / 100, q, rng.normal(size=(frames, body.nv)), rng.normal(size=(frames, body.nv)))
