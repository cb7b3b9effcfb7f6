"""How well the page that leads judges what a dance as danced tells: its score after the camera against the truth, on
virtual dancers who are filmed.

    PYTHONPATH=.:tests OMP_NUM_THREADS=1 nice python benchmarks/bench_follow.py DANCE.npz FOLDER DANCERS [POSTURES]

Every dancer is 3 to 10 degrees off in every joint and, by chance, dances with single limbs at a tenth to all of the
planned amplitude. He is drawn as a dressed figure (pyvista) and stands before the camera of a headless Chromium as a
film at 0.6 of his pace, since two shared cores without graphics look only a few times a second; the clock of the page
is that of the film. The truth is what `score_performance` tells of the same motion. Takes 80 s a dancer; what is in
FOLDER is not made anew.
"""

import io
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from browser import Page
from PIL import Image
from scipy.ndimage import gaussian_filter1d

from biodance.body.body import Body
from biodance.body.solids import segment_solids
from biodance.dance.dance import Dance
from biodance.dance.expectation import belief_after, shares, typical_noise
from biodance.dance.scoring import worth_of
from biodance.motion.kinematics import poses
from biodance.motion.regressor import predict_wrench
from biodance.motion.smoothing import smooth
from biodance.records import SIDES, Array, Motion
from biodance.report.feedback.write import write_feedback

RATE, FILM, PACE, LEAD = 25.0, 30, 0.6, 5.0
LIMBS = (
    ("left_shoulder", "left_elbow"),
    ("right_shoulder", "right_elbow"),
    ("trunk",),
    ("left_hip", "left_knee", "left_ankle"),
    ("right_hip", "right_knee", "right_ankle"),
)
SKIN, SHIRT, TROUSERS, SHOES = "#e0ac8c", "#b03a3a", "#2b3550", "#222222"
CLOTHES = {"forearm_hand": SKIN, "upper_arm": SHIRT, "trunk_head": SHIRT, "pelvis": TROUSERS, "thigh": TROUSERS,
           "shank": TROUSERS, "foot": SHOES}
FOLLOWS = """
document.getElementById("film").onclick().then(() => {
  playing = true;
  setInterval(() => { second = document.getElementById("camera").currentTime * PACE - LEAD; show(); }, 60);
});
"""


def first_postures(dance: Dance, count: int) -> Dance:
    """Return the dance up to its ``count``-th posture."""
    return replace(dance, postures=dance.postures[:count], stances=dance.stances[:count], hold=dance.hold[:count],
                   via=dance.via[: count - 1], move=dance.move[: count - 1], under=dance.under[: count - 1])


def performed(dance: Dance, seed: int) -> Motion:
    """Return how one dancer dances: limbs lazy by chance, joints off, planted feet where they are planned."""
    rng, body, plan = np.random.default_rng(seed), dance.body, dance.motion(RATE)
    q = np.array(plan.q)
    angle = q[:, 7:]
    for limb in LIMBS:
        share = rng.uniform(0.1, 1.0) if rng.random() < 0.5 else 1.0
        mine = [i for i, joint in enumerate(body.joints) if joint.name.startswith(limb)]
        angle[:, mine] = angle[0, mine] + share * (angle[:, mine] - angle[0, mine])
    wander = gaussian_filter1d(rng.normal(size=(len(q) + 400, len(body.joints))), RATE / (2 * np.pi * 0.15), axis=0)
    wander = wander[200:-200]
    angle += np.radians(rng.uniform(3, 10)) * wander / np.sqrt(np.mean(wander**2))
    feet = [body.segment_index(f"{side}_foot") for side in SIDES]
    planted = np.zeros((len(q), 2))
    for phase in dance.phases:
        during = (plan.time >= phase.start - 1e-9) & (plan.time <= phase.end + 1e-9)
        planted[np.ix_(during, list(phase.stance.planted))] = 1.0
    planted /= np.maximum(planted.sum(axis=1, keepdims=True), 1.0)
    away = (poses(body, plan.q).position - poses(body, q).position)[:, feet]
    q[:, :3] += np.einsum("tf,tfi->ti", planted, away)
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
    eyes = [(pv.Sphere(radius=0.012, center=c + [0.46 * s[0], 0.06 * s[1], z * s[2]]), "#101010") for z in (-0.2, 0.2)]
    hair = pv.Sphere(radius=0.5).scale([1.06 * s[0], s[1], 1.08 * s[2]]).translate(c + [-0.02, 0.03, 0])
    hair = hair.clip(normal=(1, -1.2, 0), origin=c + [0.02, 0.05, 0])
    nose = pv.Sphere(radius=0.018, center=c + [0.52 * s[0], -0.06 * s[1], 0])
    return [*eyes, (nose, "#d59a7c"), (hair, "#3a2616")]


def write_film(body: Body, motion: Motion, path: Path, *, per_second: int = 10) -> None:
    """Write the film of a motion for the browser's camera: JPEG pictures at 30 Hz, seen by a usual webcam."""
    pl = pv.Plotter(off_screen=True, window_size=(640, 480), lighting="light kit")
    floor = pv.Plane(center=(0, 0, -0.01), i_size=8, j_size=8)
    wall = pv.Plane(center=(-2.5, 0, 2), direction=(1, 0, 0), i_size=8, j_size=8)
    pl.add_mesh(floor, color="#a08a70", lighting=False)
    pl.add_mesh(wall, color="#8f9b93", lighting=False)
    actors = [(s, pl.add_mesh(mesh, color=colour, smooth_shading=True, ambient=0.25)) for s, mesh, colour in
              dressed(body)]
    pl.camera_position = [(2.7, 0, 1.0), (0, 0, 1.0), (0, 0, 1)]
    pl.camera.view_angle = 2 * np.degrees(np.arctan(1 / 1.9))
    pl.camera.clipping_range = (0.1, 20)
    rows = np.searchsorted(motion.time, np.arange(0, motion.time[-1], 1 / per_second) - 1e-9)
    pose = poses(body, motion.q[rows])
    with path.open("wb") as out:
        for k in range(len(rows)):
            for s, actor in actors:
                place = np.eye(4)
                place[:3, :3], place[:3, 3] = pose.rotation[k, s], pose.position[k, s]
                actor.user_matrix = place
            picture = io.BytesIO()
            Image.fromarray(pl.screenshot(return_img=True)).save(picture, "JPEG", quality=80)
            times = round(FILM / per_second / PACE) + (round(LEAD * FILM / PACE) if k == 0 else 0)
            out.write(times * picture.getvalue())
    pl.close()


def followed(page: Path, film: Path, seconds: float) -> tuple[Array, int]:
    """Return what the page thinks to be known of every segment after the dance, and how often it looked."""
    with Page(page.resolve().as_uri(), film=film, size="800,600") as browser:
        browser.run(FOLLOWS.replace("PACE", str(PACE)).replace("LEAD", str(LEAD)))
        browser.until(f"second >= {seconds - 0.2} || document.body.dataset.enough", (seconds + LEAD) / PACE + 60)
        known, looks = browser.run("[document.body.dataset.known, document.body.dataset.looks]")
    return np.array(known.split(), dtype=float), int(looks)


def main(source: str, folder: str, dancers: str, postures: str = "14") -> None:
    """Print the score beside the truth for every dancer, and how they go together."""
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    dance = first_postures(Dance.load(source), int(postures))
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
        both = [np.corrcoef(a.ravel(), b.ravel())[0, 1] for a, b in
                ((truth, score), (truth - truth.mean(axis=0), score - score.mean(axis=0)))]
        print(f"  all {both[0]:.2f}, among dancers alone {both[1]:.2f}", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
