"""How well the page that leads judges what a dance as danced tells: its score after the camera against the truth, on
virtual dancers who are filmed.

    PYTHONPATH=.:tests OMP_NUM_THREADS=1 nice python benchmarks/bench_follow.py FOLDER DANCERS

The dance is made by hand of postures that people know, both feet planted (`known_dance`). Every dancer is 3 to 10
degrees off in trunk and arms and, by chance, dances with single limbs at a tenth to all of the planned amplitude. He is
drawn as a dressed figure (pyvista) and stands before the camera of a headless Chromium as a film; the clock of the page
is that of the film, which runs at half its pace, since two shared cores without graphics look only a few times a
second. The truth is what `score_performance` tells of the same motion. Takes 2 minutes a
dancer; what is in FOLDER stays.
"""

import io
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from browser import Page
from PIL import Image
from scipy.ndimage import gaussian_filter1d

from biodance.body.body import Body
from biodance.body.human.human import human
from biodance.body.solids import segment_solids
from biodance.dance.dance import Dance
from biodance.dance.expectation import belief_after, shares, typical_noise
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
from biodance.report.feedback.write import write_feedback

RATE, FILM, LEAD, SLOW = 25.0, 30, 3.0, 2
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
BITS, BLOCK = 10, 16
"""Every picture carries its number as black and white blocks along its upper edge: a film does not keep its pace."""
FOLLOWS = """
document.getElementById("film").onclick().then(() => {
  const film = document.getElementById("camera"), strip = document.createElement("canvas");
  [strip.width, strip.height] = [BITS, 1];
  const pen = strip.getContext("2d", { willReadFrequently: true });
  playing = true;
  setInterval(() => {
    pen.drawImage(film, 0, 4, BITS * BLOCK, 8, 0, 0, BITS, 1);
    const row = pen.getImageData(0, 0, BITS, 1).data;
    let number = 0;
    for (let k = 0; k < BITS; k++) number = 2 * number + (row[4 * k] > 128 ? 1 : 0);
    if (number / PICTURES >= second || number < 5) second = number / PICTURES - (number ? 0 : LEAD);
    show();
  }, 100);
});
"""
PICTURES = 10
"""Pictures of the film for a second of the dance."""


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


def write_film(body: Body, motion: Motion, path: Path) -> None:
    """Write the film of a motion for the browser's camera: JPEG pictures at 30 Hz, seen by a usual webcam."""
    pl = pv.Plotter(off_screen=True, window_size=(640, 480), lighting="light kit")
    floor = pv.Plane(center=(0, 0, -0.01), i_size=8, j_size=8)
    wall = pv.Plane(center=(-2.5, 0, 2), direction=(1, 0, 0), i_size=8, j_size=8)
    pl.add_mesh(floor, color="#a08a70", lighting=False)
    pl.add_mesh(wall, color="#8f9b93", lighting=False)
    actors = [
        (s, pl.add_mesh(mesh, color=colour, smooth_shading=True, ambient=0.25)) for s, mesh, colour in dressed(body)
    ]
    pl.camera_position = [(2.7, 0, 1.0), (0, 0, 1.0), (0, 0, 1)]
    pl.camera.view_angle = 2 * np.degrees(np.arctan(1 / 1.9))
    pl.camera.clipping_range = (0.1, 20)
    rows = np.searchsorted(motion.time, np.arange(0, motion.time[-1], 1 / PICTURES) - 1e-9)
    pose = poses(body, motion.q[rows])
    with path.open("wb") as out:
        for k in range(len(rows)):
            for s, actor in actors:
                place = np.eye(4)
                place[:3, :3], place[:3, 3] = pose.rotation[k, s], pose.position[k, s]
                actor.user_matrix = place
            pl.render()
            seen = np.array(pl.screenshot(return_img=True))
            bits = np.repeat([(k >> (BITS - 1 - bit)) & 1 for bit in range(BITS)], BLOCK)
            seen[:BLOCK, : bits.size] = 255 * bits[None, :, None]
            picture = io.BytesIO()
            Image.fromarray(seen).save(picture, "JPEG", quality=80)
            times = SLOW * FILM // PICTURES + (round(SLOW * LEAD * FILM) if k == 0 else 0)
            out.write(times * picture.getvalue())
    pl.close()


def followed(page: Path, film: Path, seconds: float) -> tuple[Array, int]:
    """Return what the page thinks to be known of every segment after the dance, and how often it looked."""
    with Page(page.resolve().as_uri(), film=film, size="420,360") as browser:
        program = FOLLOWS
        for name in ("BITS", "BLOCK", "PICTURES", "LEAD"):
            program = program.replace(name, str(globals()[name]))
        browser.run(program)
        browser.until(f"second >= {seconds - 0.2} || document.body.dataset.enough", SLOW * (seconds + LEAD) + 90)
        known, looks = browser.run("[document.body.dataset.known, document.body.dataset.looks]")
    return np.array(known.split(), dtype=float), int(looks)


def main(folder: str, dancers: str) -> None:
    """Print the score beside the truth for every dancer, and how they go together."""
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    dance = known_dance(human(Subject(65.0, 1.75, "F", 33.0)))
    body, plan = dance.body, dance.motion(12.5)
    noise = typical_noise(np.asarray(predict_wrench(body, plan).cop().mean(axis=0)))
    write_feedback(dance, place / "page.html", force=True)
    rows = []
    for seed in range(int(dancers)):
        film, kept = place / f"{seed}.mjpeg", place / f"{seed}.npz"
        if not kept.exists():
            motion = performed(dance, seed)
            worth = worth_of(body, motion, noise=noise)
            write_film(body, motion, film)
            score, looks = followed(place / "page.html", film, dance.duration)
            np.savez(kept, truth=shares(belief_after(body, worth.H, worth.disturbed)), score=score, looks=looks)
            film.unlink()
        found = np.load(kept)
        rows.append((found["truth"], found["score"]))
        print(seed, int(found["looks"]), found["truth"].round(2), found["score"].round(2), flush=True)
        truth, score = (np.array(each) for each in zip(*rows, strict=True))
        both = [
            np.corrcoef(a.ravel(), b.ravel())[0, 1]
            for a, b in ((truth, score), (truth - truth.mean(axis=0), score - score.mean(axis=0)))
        ]
        print(f"  all {both[0]:.2f}, among dancers alone {both[1]:.2f}", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
