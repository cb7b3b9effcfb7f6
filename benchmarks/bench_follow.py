"""How well the page that leads judges what a dance as danced tells: its score after the camera against the truth, on
virtual dancers who are filmed.

    OMP_NUM_THREADS=1 nice python benchmarks/bench_follow.py FOLDER DANCERS

The dance is made by hand of postures that people know, both feet planted (`known_dance`). Every dancer is 3 to 10
degrees off in trunk and arms and, by chance, dances with single limbs at a tenth to all of the planned amplitude. He is
drawn as a dressed figure (pyvista), and 5 pictures a second go through the page's own model and program, in node
instead of a browser, so that the result does not hang on how busy the machine is (`follow_pictures.mjs`). It does not
stop when enough is known. The truth is what `score_performance` tells of the same motion. Takes 20 s of processor time
a dancer; the points that are in FOLDER stay.
"""

import json
import subprocess
import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from PIL import Image
from scipy.ndimage import gaussian_filter1d

from biodance.body.body import Body
from biodance.body.human.human import human
from biodance.body.solids import segment_solids
from biodance.dance.dance import Dance
from biodance.dance.expectation import posterior_after, shares, typical_noise
from biodance.dance.postures.ordering import support_sequence
from biodance.dance.postures.posture import initial_guess
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.stance import under
from biodance.dance.scoring import worth_of
from biodance.motion.kinematics import poses
from biodance.motion.regressor import predict_wrench
from biodance.motion.smoothing import smooth
from biodance.records import Array, Motion, Subject
from biodance.report.feedback.write import follow_scene, scene_of

RATE, PICTURES = 25.0, 5.0
"""Hz of a motion and of the pictures of it."""
PROGRAM = str(Path(__file__).with_name("follow_pictures.mjs"))
STAND = {
    "left_shoulder_adduction": -0.3,
    "right_shoulder_adduction": -0.3,
    "left_elbow_flexion": 0.2,
    "right_elbow_flexion": 0.2,
}
T = {"left_shoulder_adduction": -1.45, "right_shoulder_adduction": -1.45}
AHEAD = {"left_shoulder_flexion": 1.4, "right_shoulder_flexion": 1.4}
POSTURES: tuple[tuple[dict[str, float], tuple[float, float]], ...] = (
    ({}, (0.0, 0.0)),
    (T, (0.0, 0.0)),
    (T | {"trunk_rotation": 0.6}, (0.0, 0.0)),
    (T | {"trunk_rotation": -0.6}, (0.0, 0.0)),
    (AHEAD, (0.0, -0.14)),
    ({"right_shoulder_adduction": -2.5}, (0.0, 0.0)),
    ({"right_shoulder_adduction": -2.5, "trunk_bending": -0.35}, (0.0, 0.0)),
    ({"left_shoulder_adduction": -2.5, "trunk_bending": 0.35}, (0.0, 0.0)),
    (T | {"left_elbow_flexion": 1.5, "right_elbow_flexion": 1.5}, (0.0, 0.0)),
    (T, (0.08, -0.1)),
    (AHEAD, (-0.08, -0.1)),
    ({"trunk_flexion": 0.6}, (0.0, 0.0)),
    ({"left_shoulder_adduction": -2.5, "right_shoulder_adduction": -2.5}, (0.0, 0.0)),
    ({"left_elbow_flexion": 1.9, "right_elbow_flexion": 1.9}, (0.0, -0.14)),
    ({}, (0.0, 0.0)),
)
"""Joint angles, rad, where they differ from standing; shift of the pelvis to the left and up, m."""
LIMBS = (("left_shoulder", "left_elbow"), ("right_shoulder", "right_elbow"), ("trunk",), ())
"""What a dancer is lazy with: joints by the beginning of their names; the last is the pelvis."""
SKIN, SHIRT, TROUSERS, SHOES = "#e0ac8c", "#b03a3a", "#2b3550", "#222222"
CLOTHES = {
    "forearm_hand": SKIN,
    "upper_arm": SHIRT,
    "trunk_head": SHIRT,
    "pelvis": TROUSERS,
    "thigh": TROUSERS,
    "shank": TROUSERS,
    "foot": SHOES,
}
WIDTH, HEIGHT, FOCUS = 640, 480, 1.9
"""Pixels of a picture; focal length of a usual webcam in halves of its height."""
LOOKS = 192
"""Pixels a side of what MoveNet sees."""


def known_dance(body: Body) -> Dance:
    """Return a dance of 15 postures on both feet, 1 s each, with moves of 2 s."""
    chain = Chain(body)
    stances = support_sequence(body, Plan("known", "", (("parallel", len(POSTURES)),), hold=1.0))
    x = np.tile(initial_guess(chain, stances[0], np.random.default_rng(0)), (len(POSTURES), 1))
    x[:, 2], x[:, 3:] = 0.86, 0.0
    for row, (angles, (left, up)) in zip(x, POSTURES, strict=True):
        row[1:3] += left, up
        for name, angle in (STAND | angles).items():
            row[6 + body.joint_index(name)] = angle
    count = len(x)
    dance = Dance(
        "known",
        body,
        x,
        stances,
        np.ones(count),
        np.zeros((count - 1, 2, x.shape[1])),
        np.full(count - 1, 2.0),
        tuple(under(a, b) for a, b in pairwise(stances)),
        0,
    )
    return straight(dance, x)


def straight(dance: Dance, postures: Array) -> Dance:
    """Return the dance with other postures and straight ways between them."""
    via = postures[:-1, None] + np.array([[0.21], [0.79]]) * np.diff(postures, axis=0)[:, None]
    return replace(dance, postures=postures, via=via)


def performed(dance: Dance, seed: int) -> Motion:
    """Return how one dancer dances: limbs lazy by chance, trunk and arms off, feet where they are planned."""
    rng, body, x = np.random.default_rng(seed), dance.body, np.array(dance.postures)
    for limb in LIMBS:
        share = rng.uniform(0.1, 1.0) if rng.random() < 0.5 else 1.0
        mine = [6 + i for i, one in enumerate(body.joints) if one.name.startswith(limb)] if limb else [0, 1, 2]
        x[:, mine] = x[0, mine] + share * (x[:, mine] - x[0, mine])
    plan = straight(dance, x).motion(RATE)
    q, upper = np.array(plan.q), [1 + column for column in dance.chain.upper]
    wander = gaussian_filter1d(rng.normal(size=(len(q) + 400, len(upper))), RATE / (2 * np.pi * 0.15), axis=0)
    wander = wander[200:-200]
    q[:, upper] += np.radians(rng.uniform(3, 10)) * wander / np.sqrt(np.mean(wander**2))
    return smooth(body, plan.time, q)


def dressed(body: Body) -> list[tuple[int, Any, str]]:
    """Return segment, mesh and colour of what the figure is drawn of."""
    out = []
    for name, solid in segment_solids(body).items():
        colour = next(colour for part, colour in CLOTHES.items() if name.endswith(part))
        pieces = [(pv.wrap(solid), colour)]
        if name == "trunk_head":
            trunk, head = sorted(solid.split(only_watertight=False), key=lambda one: one.bounds[:, 1].mean())
            pieces = [(pv.wrap(trunk), SHIRT), (pv.wrap(head), SKIN), *_face(head.bounds)]
        out += [(body.segment_index(name), mesh, colour) for mesh, colour in pieces]
    return out


def _face(bounds: Array) -> list[tuple[Any, str]]:
    c, s = bounds.mean(axis=0), np.ptp(bounds, axis=0)
    eyes = [(pv.Sphere(radius=0.012, center=c + s * (0.46, 0.06, z)), "#101010") for z in (-0.2, 0.2)]
    hair = pv.Sphere(radius=0.5).scale([1.06 * s[0], s[1], 1.08 * s[2]]).translate(c + np.array((-0.02, 0.03, 0.0)))
    hair = hair.clip(normal=(1, -1.2, 0), origin=c + np.array((0.02, 0.05, 0.0)))
    nose = pv.Sphere(radius=0.018, center=c + s * (0.52, -0.06, 0.0))
    return [*eyes, (nose, "#d59a7c"), (hair, "#3a2616")]


def pictures(body: Body, motion: Motion, when: Array) -> Iterator[Array]:
    """Yield what a usual webcam sees of a motion at instants ``when`` (T,) s, (HEIGHT, WIDTH, 3) bytes."""
    pl = pv.Plotter(off_screen=True, window_size=(WIDTH, HEIGHT), lighting="light kit")
    floor = pv.Plane(center=(0, 0, -0.01), i_size=8, j_size=8)
    wall = pv.Plane(center=(-2.5, 0, 2), direction=(1, 0, 0), i_size=8, j_size=8)
    pl.add_mesh(floor, color="#a08a70", lighting=False)
    pl.add_mesh(wall, color="#8f9b93", lighting=False)
    actors = [
        (s, pl.add_mesh(mesh, color=colour, smooth_shading=True, ambient=0.25)) for s, mesh, colour in dressed(body)
    ]
    pl.camera_position = [(2.7, 0, 1.0), (0, 0, 1.0), (0, 0, 1)]
    pl.camera.view_angle = 2 * np.degrees(np.arctan(1 / FOCUS))
    pl.camera.clipping_range = (0.1, 20)
    pose = poses(body, motion.q[np.searchsorted(motion.time, when - 1e-9)])
    for k in range(len(when)):
        for s, actor in actors:
            place = np.eye(4)
            place[:3, :3], place[:3, 3] = pose.rotation[k, s], pose.position[k, s]
            actor.user_matrix = place
        pl.render()
        yield np.array(pl.screenshot(return_img=True))
    pl.close()


def points_seen(film: Iterable[Array]) -> Array:
    """Return the 17 points (T, 17, 3), x and y in pixels and how sure, that MoveNet finds in the pictures, cut about
    the person as the page does.
    """
    bundle = files("biodance.report.feedback") / "bundle"
    with subprocess.Popen(
        ["node", PROGRAM, "see", str(bundle)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as model:
        assert model.stdin is not None
        assert model.stdout is not None
        whole, out = (0.0, (HEIGHT - WIDTH) / 2, float(WIDTH)), []
        cut = whole
        for picture in film:
            for _ in range(1 if out else 3):  # people stand before the camera before they start
                x, y, size = cut
                map_ = (size / LOOKS, 0, x, 0, size / LOOKS, y)
                kind, grey = Image.Transform.AFFINE, (119, 119, 119)
                small = Image.fromarray(picture).transform(
                    (LOOKS, LOOKS), kind, map_, resample=Image.Resampling.BILINEAR, fillcolor=grey
                )
                model.stdin.write(small.convert("RGBA").tobytes())
                model.stdin.flush()
                row, column, sure = np.frombuffer(model.stdout.read(17 * 3 * 4), np.float32).reshape(17, 3).T
                found = np.column_stack([x + size * column, y + size * row, sure])
                cut = around(found) or whole
            out.append(found)
        model.stdin.close()
    return np.array(out)


def around(points: Array) -> tuple[float, float, float] | None:
    """Return the square (left, top, side) about a person of which the page takes the next look, None for all."""
    trunk = points[[5, 6, 11, 12]]
    if (trunk[:, 2] < 0.2).any():
        return None
    middle = trunk[2:, :2].mean(axis=0)
    reach = [np.abs(some[:, :2] - middle).max() for some in (trunk, points[points[:, 2] > 0.2])]
    half = max(1.9 * reach[0], 1.2 * reach[1])
    return middle[0] - half, middle[1] - half, 2 * half


def graded(dance: Dance, when: Array, points: Array) -> Array:
    """Return what the page thinks to be known (N,) of every segment after the dance."""
    scene = {"cues": scene_of(dance)["cues"], "duration_s": dance.duration, "follow": follow_scene(dance)}
    asked = {"scene": scene, "when": when.tolist(), "points": points.tolist(), "width": WIDTH, "height": HEIGHT}
    command = ["node", PROGRAM, "grade", str(files("biodance.report") / "templates")]
    done = subprocess.run(command, input=json.dumps(asked), capture_output=True, text=True, check=True)
    return np.array(json.loads(done.stdout))


def main(folder: str, dancers: str) -> None:
    """Print the score beside the truth for every dancer, and how they go together."""
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    dance = known_dance(human(Subject(65.0, 1.75, "F", 33.0)))
    body, plan = dance.body, dance.motion(12.5)
    noise = typical_noise(predict_wrench(body, plan))
    rows = []
    for seed in range(int(dancers)):
        kept, motion = place / f"{seed}.npz", performed(dance, seed)
        if not kept.exists():
            when = np.arange(0.0, motion.time[-1], 1 / PICTURES)
            np.savez(kept, when=when, points=points_seen(pictures(body, motion, when)))
        found, worth = np.load(kept), worth_of(body, motion, noise=noise)
        told = shares(posterior_after(body, worth.H, worth.disturbed))  # of this engine, whoever drew the pictures
        rows.append((told, graded(dance, found["when"], found["points"])))
        print(seed, rows[-1][0].round(2), rows[-1][1].round(2), flush=True)
        truth, score = (np.array(each) for each in zip(*rows, strict=True))
        own, mine = truth - truth.mean(axis=0), score - score.mean(axis=0)
        if seed:
            both = [np.corrcoef(a.ravel(), b.ravel())[0, 1] for a, b in ((truth, score), (own, mine))]
            each = [float(np.corrcoef(a, b)[0, 1]) for a, b in zip(own.T, mine.T, strict=True)]
            print(f"  all {both[0]:.2f}, among dancers alone {both[1]:.2f}; by segment {np.round(each, 2)}", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
