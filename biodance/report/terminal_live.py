"""What `biodance live` prints while a stream runs, and at its end."""

from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from biodance.diagnosis.watch import LiveWarning
from biodance.pipeline.live import LiveResult, LiveState
from biodance.report.wording import format_number


def state_line(state: LiveState) -> str:
    """Return what an operator must see now, in one line."""
    sure = [name.replace("_", " ") for name, verdict in state.verdicts.items() if verdict == "known"]
    known = f"known: {', '.join(sure)}" if sure else "no mass is known yet"
    suspect = f"; SUSPECT: {' '.join(state.suspect)}" if state.suspect else ""
    return f"{state.time:.0f} s, {known}{suspect}; next: {state.advice}"


def warning_line(said: LiveWarning) -> str:
    """Return a warning as one line."""
    return f"{said.time_s:.2f} s, {said.effect} {said.target}: {said.text}"


def print_live(found: LiveResult, document: dict[str, Any], console: Console) -> None:
    """Print what is known of every segment, what is suspect, and what to do next."""
    if found.identification is not None and found.identification.known:
        table = Table("segment", "mass (kg)", "95 % interval", "verdict", box=None)
        for row in document["known"]:
            if row["quantity"] == "mass":
                low, high = format_number(row["low"], 2), format_number(row["high"], 2)
                name = row["segment"].replace("_", " ")
                table.add_row(name, format_number(row["value"], 2), f"{low} to {high}", row["verdict"])
        console.print(table)
    for said in found.warnings:
        console.print(escape(f"look: {warning_line(said)}"))
    if found.cause:
        console.print(escape(found.cause))
    time = document["frame_ms"]
    console.print(
        f"{document['frames_used']} of {document['frames']} frames used; {time['median']:.1f} ms a frame of one core, "
        f"99 % within {time['p99']:.1f} ms."
    )
    console.print(f"next: {escape(found.state.advice)}")
