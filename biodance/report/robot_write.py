"""What was found of a robot, as numbers and as a page."""

from pathlib import Path
from typing import Any

from biodance.body.body_file import body_text
from biodance.pipeline.provenance import now
from biodance.pipeline.robot import RobotResult
from biodance.pipeline.robot_trials import MatchedTrial
from biodance.pipeline.saved_results import BODY_FILE
from biodance.report.documents.diagnosis import attention_document, judged_document
from biodance.report.documents.identification import agreement, identification_document
from biodance.report.documents.plain import keyed, plain_values, to_text
from biodance.report.files import write_files
from biodance.report.pages.identification import identification_section
from biodance.report.pages.template import render, template_text
from biodance.report.write import PAGE
from biodance.version import __version__


def robot_document(result: RobotResult) -> dict[str, Any]:
    """Return all that was found: as of a person (`identification_document`; "table" is the URDF), and how plate and
    encoders were brought together.

    CoM and inertia in the axes of the links of the URDF; of the root turned to x forwards, y up, z right.
    ``well_known_every_frame_independent`` counts base parameters as the paper does.
    """
    found = identification_document(result.identified)
    found["base_parameters"]["well_known_every_frame_independent"] = len(result.alone.well_known)
    return {
        "recording": result.recording.folder.name,
        "robot": {"name": result.body.name, "urdf": result.urdf.name, "joints": len(result.body.joints)},
        "attention": attention_document(result.attention),
        "judged": judged_document(result.judged),
        **found,
        "diagnosis": _diagnosis(result),
        "in_root_frame": {
            name: {"table": agreement(table), "identified": agreement(found)}
            for name, (table, found) in result.in_root.items()
        },
        "matched": [_matched(one) for one in result.trials],
        "provenance": {"created": now(), "versions": {"biodance": __version__}},
    }


def _diagnosis(result: RobotResult) -> dict[str, Any]:
    """Return what is not as drawn: the verdict, and the findings."""
    keys = (
        "cause=cause.kind where=cause.where value sd unit=cause.unit evidence_nats=gain evidence_on_kept_nats=kept_gain"
    )
    findings = [
        keyed(one, keys) | {"not_told_from": [f"{rival.kind} {rival.where}" for rival in one.rivals]}
        for one in result.causes
    ]
    return {"verdict": result.verdict, "findings": findings}


_MATCHED = (
    "delay_s=plate.delay place_m=plate.place yaw_rad=plate.yaw correlation=plate.correlation scale=plate.scale "
    "surprise=innovation"
)


def _matched(one: MatchedTrial) -> dict[str, Any]:
    encoders, plate = one.recorded.files
    return {
        **keyed(one, "trial=recorded.name role=recorded.role"),
        "encoders": encoders.name,
        "plate": plate.name,
        **keyed(one.recorded, "encoders_hz=encoders.rate plate_hz=wrench.rate"),
        **keyed(one, _MATCHED),
        "standing": [{"foot": f, "start_s": a, "end_s": b} for f, a, b in one.motion.grounded.supports],
        "history": one.recorded.history,
    }


def write_robot(result: RobotResult, folder: Path) -> dict[str, Any]:
    """Write ``report.html``, ``results.json`` and, where a body was found, ``body.json``; return the numbers."""
    numbers = robot_document(result)
    content = {"results.json": to_text(numbers), PAGE: _page(result, numbers)}
    done = result.identified.identification
    if done.status == "solved":
        content[BODY_FILE] = body_text(
            done.identified, f"Recording {result.recording.folder.name} of {result.body.name}."
        )
    write_files(folder, content)
    return dict(plain_values(numbers))


def _page(result: RobotResult, numbers: dict[str, Any]) -> str:
    from markupsafe import Markup

    return render(
        "robot.html.j2",
        scripts=[template_text("curves.js")],
        model=result.body.name,
        numbers=numbers,
        version=__version__,
        section=Markup(identification_section(result.identified)),
    )
