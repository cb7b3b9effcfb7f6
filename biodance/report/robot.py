"""What was found of a robot: numbers, page, and what the commands print."""

from pathlib import Path

from rich.console import Console

from biodance.body.body import body_text
from biodance.display import spaced
from biodance.pipeline.robot import RobotResult
from biodance.pipeline.saved_results import BODY_FILE, now
from biodance.report.files import write_results
from biodance.report.pages.identification import identification_section
from biodance.report.pages.template import render, template_text
from biodance.report.tables.diagnosis import ATTENTION_ROW, JUDGED_ROW
from biodance.report.tables.identification import AGREEMENT_ROW, identification_document
from biodance.report.tables.schema import Row, Schema
from biodance.report.terminal import print_attention, print_line
from biodance.report.wording import format_number
from biodance.report.write import PAGE
from biodance.version import __version__

_ROBOT = Schema(
    "recording=recording.folder.name",
    {
        "robot": Schema("name=body.name urdf=urdf.name joints=#body.joints").row,
        "attention": ATTENTION_ROW,
        "judged": JUDGED_ROW,
    },
)
_IN_ROOT = Schema("", {"table": AGREEMENT_ROW.at("0"), "identified": AGREEMENT_ROW.at("1")})
_CAUSE = Schema(
    "cause=cause.kind where=cause.where value sd unit=cause.unit probability evidence_nats=gain "
    "evidence_on_kept_nats=kept_gain",
    {"not_told_from": lambda one: [f"{rival.kind} {rival.where}" for rival in one.rivals]},
)
_MATCHED = Schema(
    "trial=recorded.name role=recorded.role encoders=recorded.files.0.name plate=recorded.files.1.name "
    "encoders_hz=recorded.encoders.rate plate_hz=recorded.wrench.rate delay_s=plate.delay place_m=plate.place "
    "yaw_rad=plate.yaw correlation=plate.correlation scale=plate.scale surprise=innovation history=recorded.history",
    {"standing": Schema("foot=0 start_s=1 end_s=2").at("grounded.supports")},
    "trial: {trial} | role: {role} | delay (s): {delay_s:+.3f} | x, y (mm): {place_m:mm0} | "
    "turn (deg): {yaw_rad:deg1} | correlation: {correlation:.3f} | foot, until (s): {feet}",
)


def robot_document(result: RobotResult) -> Row:
    """Return all that was found: as of a person (`identification_document`; "table" is the URDF), and how plate and
    encoders were brought together.

    CoM and inertia in the axes of the links of the URDF; of the root turned to x forwards, y up, z right.
    ``well_known_every_frame_independent`` counts base parameters as the paper does.
    """
    found = identification_document(result.identified)
    found["base_parameters"]["well_known_every_frame_independent"] = len(result.alone.well_known)
    return {
        **_ROBOT.row(result),
        **found,
        "diagnosis": {"verdict": result.verdict, "findings": _CAUSE.rows(result.causes)},
        "in_root_frame": {name: _IN_ROOT.row(pair) for name, pair in result.in_root.items()},
        "matched": _MATCHED.rows(result.trials),
        "provenance": {"created": now(), "versions": {"biodance": __version__}},
    }


def write_robot(result: RobotResult, folder: Path) -> Row:
    """Write ``report.html``, ``results.json`` and, where a body was found, ``body.json``; return the numbers."""
    from markupsafe import Markup

    numbers = robot_document(result)
    page = render(
        "robot.html.j2",
        scripts=[template_text("curves.js")],
        model=result.body.name,
        numbers=numbers,
        schemas={"matched": _MATCHED},
        matched=[
            row | {"feet": ", ".join(f"{one['foot']} {one['end_s']:.1f}" for one in row["standing"])}
            for row in numbers["matched"]
        ],
        section=Markup(identification_section(result.identified)),
    )
    content = {PAGE: page}
    done = result.identified.identification
    if done.status == "solved":
        content[BODY_FILE] = body_text(
            done.identified, f"Recording {result.recording.folder.name} of {result.body.name}."
        )
    return write_results(folder, numbers, content)


def print_robot_diagnosis(found: Row, console: Console) -> None:
    """Print what is not as drawn about a robot (`robot_document`): the verdict, causes with size and evidence."""
    print_attention(found["attention"], console)
    print_line(console, f"verdict: {found['diagnosis']['verdict']}")
    for one in found["diagnosis"]["findings"]:
        size = f"{format_number(one['value'], 4)} ± {format_number(1.96 * one['sd'], 4)} {one['unit']}".rstrip()
        others = f"; it could also be {', '.join(one['not_told_from'])}" if one["not_told_from"] else ""
        text = f"{spaced(one['cause'])}, {one['where']}: {size}, P = {one['probability']:.2f}{others}"
        print_line(console, text)
