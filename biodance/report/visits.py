"""What `biodance compare` prints for a person."""

from rich.console import Console

from biodance.pipeline.visits import VisitComparison
from biodance.report.tables.schema import Row
from biodance.report.tables.visits import QUANTITY_ROW, shown_quantities, visit_place
from biodance.report.terminal import print_line, print_table


def print_compared(found: VisitComparison, document: Row, console: Console) -> None:
    """Print the sentence, the quantities that changed, and what needs a person."""
    print_line(console, document["text"])
    if found.changed:
        print_table(QUANTITY_ROW, [row for row in shown_quantities(found) if row["changed"]], console)
    for one in document["attention"]:
        print_line(console, f"{visit_place(one)}: {one['text']}")
    for note in document["notes"]:
        print_line(console, note)
