"""The pages of the report on what the body weighs: figures, tables and sentences; computes nothing."""

from biodance.identification.knowledge import QUANTITIES
from biodance.identification.load_words import say_load
from biodance.identification.sessions import certain_changes
from biodance.pipeline.identification import SessionIdentification
from biodance.records import CHANNELS
from biodance.report.documents.identification import information_share, segment_rows, torques_document
from biodance.report.figures.identification import drawn_joints, forest_figure, impact_figure, torque_figure
from biodance.report.figures.sessions import changes_figure, excitation_figure
from biodance.report.pages.template import render
from biodance.report.wording import format_number

MARKS = {"known": "●", "partly known": "◐", "cannot be known": "○"}
LISTED = "Cannot be known"
"""Start of the note whose content the page shows as a table."""
_UNITS = ("N",) * 3 + ("N·m",) * 3


def spaced(name: str) -> str:
    """Return a segment's name as words."""
    return name.replace("_", " ")


def small(value: float) -> str:
    """Return a probability as text, however small."""
    return format_number(value, 3) if value >= 0.001 else "below 0.001"


def identification_section(found: SessionIdentification) -> str:
    """Return the sections as HTML text; the same argument gives the same characters."""
    from markupsafe import Markup

    one, sure = found.identification, certain_changes(found.changes)
    rows = [(name, segment_rows(one, name)) for name in one.sip.segments] if one.status == "solved" else []
    return render(
        "identification.html.j2",
        filters={"spaced": spaced, "small": small},
        one=one,
        notes=[note for note in found.notes if not note.startswith(LISTED)],
        failures=found.failures,
        girths="; ".join(f"{spaced(name)}: {spaced(', '.join(said))}" for name, said in one.body.girths.items()),
        forest=Markup(forest_figure(one)) if rows else "",
        segments=[(name, known, information_share(known)) for name, known in rows],
        quantities=QUANTITIES,
        marks=MARKS,
        gain=found.gain,
        trials=[(trial, "kept") for trial in found.validations] + [(trial, "fitted") for trial in found.fitted],
        channels=list(zip(CHANNELS, _UNITS, strict=True)),
        ranked=Markup(impact_figure(found.impacts)) if found.impacts else "",
        torques=found.torques,
        torque_rows=(torques_document(found.torques) or {}).get("joints", []),
        torque_image=Markup(torque_figure(found.torques)) if found.torques and drawn_joints(found.torques) else "",
        search=found.search,
        load=say_load(found.search),
        changes=[row for row in found.changes if row.quantity == "mass"],
        comparison=Markup(changes_figure(found.changes, sure)) if found.changes else "",
        certain=sure,
        total=len(found.changes),
        performance=found.performance,
        danced=Markup(excitation_figure(found.performance)) if found.performance else "",
    )
