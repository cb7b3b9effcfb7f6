"""Write the page that leads a person through a dance: one file, no network, opened from disk."""

from base64 import b64encode
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from biodance.body.body import Body
from biodance.body.solids import segment_solids
from biodance.dance.cues import Say, dance_instructions, in_english, rests, skipping
from biodance.dance.dance import Dance
from biodance.dance.expectation import movement_information
from biodance.dance.problem.feet import plate_corners
from biodance.dance.problem.stance import Stance, stance_words
from biodance.display import spaced
from biodance.errors import BiodanceError
from biodance.motion.kinematics import poses
from biodance.pipeline.dance import not_safe
from biodance.pipeline.still import parent_segments
from biodance.records import SIDES, Array, side_in_name
from biodance.report.files import refuse_page, write_files
from biodance.report.pages.language import ENGLISH, Language, read_language, script_words
from biodance.report.pages.template import render, script_json, template_text, three_js
from biodance.report.tables.schema import Schema

_POINTS = {"upper_arm": "shoulder", "forearm_hand": "elbow", "thigh": "hip", "shank": "knee", "foot": "ankle"}
"""Segment -> the point at its origin."""
_WRISTS = ("{}WRA", "{}WRB")
_NUMBERS = {"shoulder": 5, "elbow": 7, "wrist": 9, "hip": 11, "knee": 13, "ankle": 15}
"""Of the left point among the 17 of MoveNet (order of COCO); the right one comes next."""
_ASKED = {"elbow": 1.0, "wrist": 1.0, "knee": 1.0, "shoulder": 0.8}
"""Points that a person is asked to correct, and how readily; the others follow them."""
_LIMBS, _TRUNK = 0.6, 0.25
"""rad, standard deviation of a joint angle about the plan: what the camera does not tell stays near it."""


def follow_scene(dance: Dance) -> dict[str, Any] | None:
    """Return what follows a person through ``dance``; None for a body whose joints no camera knows (a robot)."""
    body, points = dance.body, _points(dance.body)
    if not points or not body.n_root:
        return None
    told = movement_information(dance)
    return {
        "rate": told.rate,
        "plan": _packed(dance.motion(told.rate).q),
        "root": _packed(told.root),
        **Schema("weights edges still about").row(told),
        "gravity": body.gravity,
        "segments": [
            spaced(name.replace("_head", " and head").replace("_hand", " and hand")) for name in body.segments
        ],
        "carriers": body.segment_joint,
        "joints": _JOINT.rows(body.joints),
        "points": points,
        "phases": Schema(
            "kind posture start end",
            {"planted": lambda phase: [body.feet[SIDES[side]].segment for side in phase.stance.planted]},
        ).rows(dance.phases),
    }


_JOINT = Schema(
    "parent translation axis",
    {
        "rotation": lambda joint: joint.rotation.ravel(),
        "free": lambda joint: _TRUNK if joint.name.startswith("trunk") else _LIMBS,
    },
)


def _packed(values: ArrayLike, kind: str = "<f4") -> str:
    return b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")


def _points(body: Body) -> list[dict[str, Any]]:
    """Return the body's points that the camera finds, by the numbers of MoveNet, and how readily each is corrected."""
    out = []
    for second, side in enumerate(("left", "right")):
        for part, name in _POINTS.items():
            if f"{side}_{part}" not in body.segments:
                return []
            out.append((f"{side} {name}", body.segment_index(f"{side}_{part}"), np.zeros(3), name, second))
        wrist = [
            body.markers.names.index(n) for one in _WRISTS if (n := one.format(side[0].upper())) in body.markers.names
        ]
        if not wrist:
            return []
        place = body.markers.position[wrist].mean(axis=0)
        out.append((f"{side} wrist", body.markers.segment[wrist[0]], place, "wrist", second))
    keys = ("name", "number", "segment", "place", "asks")
    return [
        dict(zip(keys, (called, _NUMBERS[name] + second, int(segment), place, _ASKED.get(name, 0.0)), strict=True))
        for called, segment, place, name, second in out
    ]


_RATE = 15.0  # Hz of the poses; the page turns and shifts evenly between two
_SQUARE = (0.6, 0.6)  # m that is drawn where the plate is not known
_FACTOR = 1e4  # Steps a metre: positions are whole numbers of 0.1 mm


def scene_of(dance: Dance, say: Say = in_english) -> dict[str, Any]:
    """Return what the page shows of a dance, as plain values, its words as one may ``say`` them.

    Returns
    -------
    dict
        ``name``, ``duration_s``, ``rate_hz``, ``frames``; ``segments`` with ``name``, ``side``, ``vertices`` (V, 3)
        float32 m in the segment's frame and ``faces`` (F, 3) uint16; ``poses`` (frames, segments, 7) int16: position in
        0.1 mm of the lab, z up, and quaternion x, y, z, w in steps of 1/32767; arrays little-endian in base64;
        ``parent`` the segment (its number here) that carries it, -1 none; ``plate`` (4, 2) m corners of the plate for
        which it was made, else of a square about the feet; ``cues``, one a posture (`_cues`); ``mark`` by which a log
        of a visit knows the dance, ``still`` what is said during a hold.

    Raises
    ------
    BiodanceError
        The dance leaves the room of 3.2 m about the lab origin that the page can show.
    """
    body, solids = dance.body, segment_solids(dance.body)
    motion, parents = dance.motion(_RATE), parent_segments(body)
    pose = poses(body, motion.q)
    chosen = [k for k, name in enumerate(dance.body.segments) if name in solids]
    place = _FACTOR * pose.position[:, chosen]
    if not np.abs(place).max() < 32767:
        raise BiodanceError(
            f"The dance goes {np.abs(place).max() / _FACTOR:.1f} m from the lab origin; the page shows 3.2 m about it."
        )
    turn = Rotation.from_matrix(pose.rotation[:, chosen].reshape(-1, 3, 3)).as_quat().reshape(*place.shape[:2], 4)
    placed = np.round(np.concatenate([place, 32767 * turn], axis=2))
    named = [(body.segments[k], parents[k]) for k in chosen]
    return {
        "name": dance.protocol,
        "duration_s": dance.duration,
        "rate_hz": _RATE,
        "frames": len(placed),
        "segments": [
            {
                "name": name,
                "side": side_in_name(name, ""),
                "parent": chosen.index(parent) if parent in chosen else -1,
                "vertices": _packed(solids[name].vertices),
                "faces": _packed(solids[name].faces, "<u2"),
            }
            for name, parent in named
        ],
        "poses": _packed(placed, "<i2"),
        "plate": plate_corners(dance.stances, dance.plate or _SQUARE).round(4),
        "mark": dance.mark,
        "still": say("Sit still") if any(stance.seat for stance in dance.stances) else say("Stand still"),
        "cues": _cues(dance, say),
    }


def _cues(dance: Dance, say: Say) -> list[dict[str, Any]]:
    """Return of every posture: ``number`` as on the cue sheet, ``move_s`` when to begin to move, ``hold_s`` from when
    and ``end_s`` until when to stand still, ``calls`` what to do, ``after_skips`` the same where one, two, three
    postures before it are left out (as far as the feet stay where they are), ``can_half`` whether half of the way to it
    is a posture, too, ``rest`` whether the person rests after it, ``stance`` in words, ``feet`` the outlines of the
    planted soles (P, 2) m.
    """
    said, pauses = dance_instructions(dance, say), rests(dance)
    holds = {phase.posture: phase for phase in dance.phases if phase.kind == "hold"}
    moves = {phase.posture: phase for phase in dance.phases if phase.kind == "move"}
    return [
        {
            "number": p + 1,
            "move_s": moves[p].start if p in moves else 0.0,
            "hold_s": holds[p].start if p in holds else moves[p].end,
            "end_s": holds[p].end if p in holds else moves[p].end,
            "calls": list(said[p]),
            "after_skips": [list(skipping(dance, p, p - n, say)) for n in range(2, 5) if _same_feet(dance, p, p - n)],
            "can_half": _same_feet(dance, p, p - 1),
            "rest": pauses[p],
            "stance": say(stance_words(stance)),
            "feet": [_outline(stance, side) for side in stance.planted],
        }
        for p, stance in enumerate(dance.stances)
    ]


def _same_feet(dance: Dance, p: int, before: int) -> bool:
    """Return whether the feet stay where they are from posture ``before`` to posture ``p``."""
    feet = {(s.planted, s.over, s.ankle.tobytes()) for s in dance.stances[max(before, 0) : p + 1]}
    return before >= 0 and len(feet) == 1


def _outline(stance: Stance, side: int) -> Array:
    """Return the outline of a planted sole on the floor, (P, 2) m, in order about its middle."""
    points = stance.soles[side][:, :2]
    # a sole is convex: its corners in order of their angle about the middle are its outline
    from_middle = points - points.mean(axis=0)
    order = np.argsort(np.arctan2(from_middle[:, 1], from_middle[:, 0]))
    return points[order].round(4)


_BUNDLE = {"program": "pose.js", "kernels": "pose.wasm", "model": "movenet.json", "weights": "movenet.bin"}
"""What follows a person: parts of the bundle that `make bundle` writes into ``report/feedback``."""


def write_feedback(
    dance: Dance, path: Path, *, force: bool = False, despite: bool = False, language: str | Path = ENGLISH
) -> bool:
    """Write the page of a dance to ``path``, in a ``language`` of `read_language`, and return whether it follows the
    person (see `bundle`).

    Of one that imprecise people cannot dance safely only ``despite`` that; the page then says so on top.

    Raises
    ------
    BiodanceError
        The dance is not safe and ``despite`` was not given, the name does not end in .html, there is a file of that
        name and ``force`` was not given, the folder is missing, the dance is that of a robot without solids, or the
        drawing library is missing.
    """
    refuse_page(path, force=force)
    unsafe = not_safe(dance)
    if unsafe and not despite:
        raise BiodanceError(f"{' '.join(unsafe)} Or give --despite: then there is a page, which says this on top.")
    words = read_language(language)
    unsafe = not_safe(dance, words.say, words.number)
    scene, carried = scene_of(dance, words.say), bundle()
    scene["follow"] = follow_scene(dance) if carried else None
    page = feedback_page(dance.protocol, scene, carried if scene["follow"] else None, unsafe, dance.care, words)
    write_files(path.parent, {path.name: page})
    return scene["follow"] is not None


def bundle() -> dict[str, str] | None:
    """Return what follows a person, in base64, with its ``notices``; None where it was not built."""
    folder = files("biodance.report") / "feedback" / "bundle"
    if not all((folder / name).is_file() for name in (*_BUNDLE.values(), "NOTICES.txt")):
        return None
    parts = {key: b64encode((folder / name).read_bytes()).decode("ascii") for key, name in _BUNDLE.items()}
    return parts | {"notices": (folder / "NOTICES.txt").read_text(encoding="utf-8").replace("--", "- -")}


def feedback_page(
    name: str,
    scene: dict[str, Any],
    carried: dict[str, str] | None,
    unsafe: tuple[str, ...] = (),
    care: tuple[str, ...] = (),
    words: Language | None = None,
) -> str:
    """Return a dance's page: `scene_of`, what follows the person or None, what is not safe, care, language."""
    from markupsafe import Markup

    words = words or read_language()
    visit, following = template_text("visit.js"), template_text("follow_body.js") + template_text("follow.js")
    program = template_text("feedback.js")
    said = {} if words.tag == ENGLISH else script_words((program, visit, following), words.catalogue.gettext)

    return render(
        "feedback.html.j2",
        language=words.tag,
        say=words.say,
        name=spaced(name),
        care=[words.say(one) for one in care],
        unsafe=unsafe,
        style=Markup(template_text("feedback.css")),
        program=Markup(program),
        visit=Markup(visit),
        three=Markup(three_js()),
        scene=Markup(script_json(scene | {"words": said})),
        bundle={key: Markup(value) for key, value in carried.items()} if carried else None,
        following=Markup(following),
    )
