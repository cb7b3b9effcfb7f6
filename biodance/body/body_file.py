"""A Body as a JSON file, without loss: what `biodance identify` keeps for `biodance export`."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from biodance.body.body import Body
from biodance.body.parts import Foot, Joint, JointError, JointLimits, Part, SegmentMarkers
from biodance.errors import BiodanceError, FileRefused
from biodance.library import refuse_special
from biodance.records import Sip

_VERSION = 1


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
        found: dict[str, Any] = json.loads(text)
        if found.get("biodance_body") != _VERSION:
            raise FileRefused(f"{where}: is no body of version {_VERSION}. Run biodance identify again.")
        return _body(found), str(found["source"])
    except FileRefused:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, BiodanceError) as error:
        raise FileRefused(
            f"{where}: is not a body that biodance wrote ({error}). Run biodance identify again."
        ) from error


def _body(found: dict[str, Any]) -> Body:
    return Body(
        name=found["name"],
        segments=tuple(found["segments"]),
        joints=tuple(Joint(**joint) for joint in found["joints"]),
        sip=_sip(found["sip"]),
        limits=JointLimits(**found["limits"]),
        markers=_markers(found["markers"]),
        boxes=found["boxes"],
        com_boxes=found["com_boxes"],
        feet={side: Foot(**foot) for side, foot in found["feet"].items()},
        root=found["root"],
        notes=tuple(found["notes"]),
        joint_errors=tuple(JointError(*error) for error in found["joint_errors"]),
        **({"gravity": found["gravity"]} if "gravity" in found else {}),
        at_joint=_sip(found["at_joint"]) if found.get("at_joint") else None,
        girths={segment: tuple(said) for segment, said in found.get("girths", {}).items()},
        parts=tuple(Part(**part) for part in found.get("parts", ())),
    )


def _sip(found: dict[str, Any]) -> Sip:
    return Sip(**{**found, "segments": tuple(found["segments"])})


def _markers(found: dict[str, Any]) -> SegmentMarkers:
    place = np.reshape(found["position"], (-1, 3))  # a robot may have none
    return SegmentMarkers(tuple(found["names"]), tuple(found["segment"]), place, np.array(found["weight"]))
