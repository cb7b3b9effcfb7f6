"""A Body as a JSON file, without loss: what `biodance identify` keeps for `biodance export`."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from biodance.body.body import Body
from biodance.body.parts import Foot, Joint, JointError, JointLimits, Part, SegmentMarkers
from biodance.errors import BiodanceError, FileRefused
from biodance.library import parse_json, refuse_special
from biodance.records import Sip

_VERSION = 1
_HEAVIEST = 1000.0
"""kg of a whole body: people, and robots that stand on force plates."""
_FARTHEST = 10.0
"""m of a place in a segment, or of a joint from its parent."""


def body_text(body: Body, source: str) -> str:
    """Return the file's text; ``source`` says in a sentence where the parameters come from."""
    return json.dumps({"biodance_body": _VERSION, "source": source, **asdict(body)}, default=np.ndarray.tolist) + "\n"


def read_body(path: str | Path) -> tuple[Body, str]:
    """Return the body of a file that ``body_text`` made, and its source.

    Raises
    ------
    FileRefused
        The file cannot be read, is of another version, or is not such a file.
    """
    refuse_special(Path(path))
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise FileRefused(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error}).") from error
    return parse_body(text, str(path))


def parse_body(text: str, where: str) -> tuple[Body, str]:
    """Return the body and its source from the ``text`` of `body_text`; ``where`` it was found, for messages.

    Raises
    ------
    FileRefused
        The text is of another version or is not such a body.
    """
    try:
        raw: dict[str, Any] = parse_json(text)
        if raw.get("biodance_body") != _VERSION:
            raise FileRefused(f"{where}: is no body of version {_VERSION}. Run biodance identify again.")
        return _possible(_body(raw)), str(raw["source"])
    except FileRefused:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, BiodanceError) as error:
        raise FileRefused(
            f"{where}: is not a body that biodance wrote ({error}). Run biodance identify again."
        ) from error


def _body(raw: dict[str, Any]) -> Body:
    worn = raw["markers"]
    place = np.reshape(worn["position"], (-1, 3))  # a robot may have none
    return Body(
        name=raw["name"],
        segments=tuple(raw["segments"]),
        joints=tuple(Joint(**joint) for joint in raw["joints"]),
        sip=Sip(**raw["sip"]),
        limits=JointLimits(**raw["limits"]),
        markers=SegmentMarkers(tuple(worn["names"]), tuple(worn["segment"]), place, np.array(worn["weight"])),
        boxes=raw["boxes"],
        com_boxes=raw["com_boxes"],
        feet={side: Foot(**foot) for side, foot in raw["feet"].items()},
        root=raw["root"],
        notes=tuple(raw["notes"]),
        joint_errors=tuple(JointError(*error) for error in raw["joint_errors"]),
        **({"gravity": raw["gravity"]} if "gravity" in raw else {}),
        at_joint=Sip(**raw["at_joint"]) if raw.get("at_joint") else None,
        girths={segment: tuple(names) for segment, names in raw.get("girths", {}).items()},
        parts=tuple(Part(**part) for part in raw.get("parts", ())),
    )


def _possible(body: Body) -> Body:
    """Return the body.

    Raises
    ------
    ValueError
        A number is none, or of no body: says where, its value and what is legal.
    """
    sip = body.sip
    places = {
        "centre of mass": sip.com,
        "place of a joint": np.array([joint.translation for joint in body.joints]),
        "place of a marker": body.markers.position,
    }
    for what, array in {"parameters": sip.phi, "covariance of the parameters": sip.covariance, **places}.items():
        if not np.isfinite(array).all():
            raise ValueError(f"{what}: {np.ravel(array)[~np.isfinite(np.ravel(array))][0]} is no number")
    for what, array in places.items():
        if np.abs(array).max(initial=0.0) > _FARTHEST:
            raise ValueError(f"{what}: {np.abs(array).max():.3g} m; legal are up to {_FARTHEST:g} m")
    if not np.allclose(sip.covariance, sip.covariance.T, rtol=1e-6, atol=1e-15):
        raise ValueError("covariance of the parameters: what two have in common stands there twice, and differs")
    worst, whole = float(sip.mass.min()), float(sip.mass.sum())
    if worst < 0 or not 0 < whole <= _HEAVIEST:
        raise ValueError(
            f"mass: {whole:.3g} kg in all, least {worst:.3g}; legal are up to {_HEAVIEST:g} kg, none below 0"
        )
    return body
