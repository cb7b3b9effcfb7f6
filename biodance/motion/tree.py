"""Constants of a Body's tree, laid out for kinematics that are batched over frames with the frame as the LAST axis.

Slot 0 is the root, slot ``i + 1`` is joint ``i``. Every array of a batch ends with the frame axis, so that numpy's inner loops run
over frames and one call serves a whole level of the tree.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.motion.ball import Balls, balls
from biodance.records import Array

Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Branches:
    """G chains of joints without a fork that are equally long and hang equally deep, for example the two legs.

    ``own`` (G, m) joints of each chain; ``above`` (G, k) the joints between the root and the chain; ``parent`` (G): the index of the family
    and the row in it of the branch that carries each, (-1, 0) for the root.
    """

    own: Index
    above: Index
    parent: tuple[tuple[int, int], ...]


@dataclass(frozen=True, eq=False)
class Tree:
    """The tree of a body as arrays.

    ``turn`` (n, 9, 3): local rotation of a joint = turn @ [1, sin, 1 - cos] (rows of the 3 x 3 matrix); ``translation`` (n, 3) m;
    ``axis`` (n, 3); ``levels``: (slots, parents' slots) per depth; ``carrier`` (N) slot that carries each segment; ``below`` (n + 1, N)
    1 where a segment moves with a slot; ``branches`` carriers first; ``balls`` the ball joints; ``lower``, ``upper`` (n, 1) rad;
    ``n_root`` 6 or 0.
    """

    turn: Array
    translation: Array
    axis: Array
    levels: tuple[tuple[Index, Index], ...]
    carrier: Index
    below: Array
    branches: tuple[Branches, ...]
    balls: Balls
    lower: Array
    upper: Array
    n_root: int

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return len(self.axis)


def tree_of(body: Body) -> Tree:
    """Return the tree of ``body``, laid out for batches."""
    n = len(body.joints)
    parents = np.array([joint.parent for joint in body.joints], dtype=np.intp)
    carrier = np.array(body.segment_joint, dtype=np.intp) + 1
    chains = [_chain(parents, i) for i in range(n)]
    below = np.zeros((n + 1, len(body.segments)))
    below[0] = 1.0
    for segment, slot in enumerate(carrier):
        if slot:
            below[chains[slot - 1] + 1, segment] = 1.0
    return Tree(
        turn=np.array([_turn(joint.rotation, joint.axis) for joint in body.joints]).reshape(n, 9, 3),
        translation=np.array([joint.translation for joint in body.joints]).reshape(n, 3),
        axis=np.array([joint.axis for joint in body.joints]).reshape(n, 3),
        levels=_levels(parents, chains),
        carrier=carrier,
        below=below,
        branches=_branches(parents, chains),
        balls=balls(body),
        lower=body.limits.lower[:, None],
        upper=body.limits.upper[:, None],
        n_root=body.n_root,
    )


def _turn(rotation: Array, axis: Array) -> Array:
    """Return (9, 3): coefficients of 1, sin, 1 - cos in ``rotation @ exp(axis angle)`` (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.stack([rotation.ravel(), (rotation @ cross).ravel(), (rotation @ cross @ cross).ravel()], axis=1)


def _chain(parents: Index, joint: int) -> Index:
    """Return the joints from the root down to ``joint``, itself included."""
    chain = [joint]
    while parents[chain[-1]] >= 0:
        chain.append(int(parents[chain[-1]]))
    return np.array(chain[::-1], dtype=np.intp)


def _levels(parents: Index, chains: list[Index]) -> tuple[tuple[Index, Index], ...]:
    depth = np.array([len(chain) for chain in chains], dtype=int)
    levels = [np.flatnonzero(depth == d) for d in range(1, depth.max(initial=0) + 1)]
    return tuple((level + 1, parents[level] + 1) for level in levels)


def _branches(parents: Index, chains: list[Index]) -> tuple[Branches, ...]:
    """Cut the tree into chains at its forks and gather chains of one shape; a family comes after the families that carry it."""
    children = np.bincount(parents[parents >= 0], minlength=len(parents)) if len(parents) else np.zeros(0)
    owned: dict[int, list[int]] = {}
    head = np.arange(len(parents))
    for joint, parent in enumerate(parents):
        if parent >= 0 and children[parent] == 1:
            head[joint] = head[parent]
        owned.setdefault(int(head[joint]), []).append(joint)
    shapes = sorted({(len(chains[first]) - 1, len(own)) for first, own in owned.items()})
    families = [[first for first, own in owned.items() if (len(chains[first]) - 1, len(own)) == shape] for shape in shapes]
    place = {first: (f, row) for f, family in enumerate(families) for row, first in enumerate(family)}
    return tuple(
        Branches(
            own=np.array([owned[first] for first in family], dtype=np.intp),
            above=np.array([chains[first][:-1] for first in family], dtype=np.intp).reshape(len(family), -1),
            parent=tuple(place[int(head[parents[first]])] if parents[first] >= 0 else (-1, 0) for first in family),
        )
        for family in families
    )
