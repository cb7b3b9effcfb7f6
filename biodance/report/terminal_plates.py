"""What `biodance plates` and `biodance learn` print for a person."""

from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from biodance.report.wording import format_number, millimetres


def print_plates(document: dict[str, Any], console: Console) -> None:
    """Print a row per plate, then everything that a person must see."""
    table = Table("plate", "visits", "place x, y (mm)", "gain (%)", "offset Fx, Fy, Fz (N)", "delay (ms)", "changes")
    for card in document["plates"]:
        gain, delay = card["gain"], card["delay_s"]
        table.add_row(
            card["plate"],
            str(card["visits"]),
            ", ".join(millimetres(value) for value in card["place_m"]),
            format_number(None if gain is None else 100 * gain, 2),
            ", ".join(format_number(value) for value in card["offset_n"]),
            millimetres(delay),
            str(len(card["changes"])),
        )
    console.print(table)
    for one in document["attention"]:
        console.print(escape(one["text"]), soft_wrap=True)
    for person in document["persons"]:
        for one in person["findings"]:
            console.print(escape(f"Person {person['person']}: {one['text']}"), soft_wrap=True)
    for what, why in document["refused"].items():
        console.print(escape(f"{what} was left out: {why.splitlines()[0]}"), soft_wrap=True)
    for note in document["notes"]:
        console.print(escape(note), soft_wrap=True)


def print_learned(document: dict[str, Any], console: Console) -> None:
    """Print what a laboratory learned: sessions, norms, what changed most."""
    console.print(f"Learned from {len(document['sessions'])} sessions: {', '.join(document['sessions'])}")
    table = Table("what", "usual", "sd between sessions", "unit", "sessions")
    for one in document["norms"]:
        table.add_row(
            one["name"], f"{one['value']:.3g}", f"{one['between_sessions_sd']:.2g}", one["unit"], str(one["sessions"])
        )
    console.print(table)
    for one in document["changed_most"]:
        console.print(f"{one['key']}: {one['size']:.3g} instead of {one['shipped']:.3g}", highlight=False)
    for what, why in document["left_out"].items():
        console.print(escape(f"{what} was left out: {why.splitlines()[0]}"), soft_wrap=True)
