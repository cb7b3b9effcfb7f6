"""What the commands print for a person: short tables and sentences on the terminal, of the documents for programs."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from biodance.diagnosis.consequence import LIMIT
from biodance.diagnosis.diagnosis import ABOUT
from biodance.display import cause_in_words, spaced
from biodance.doctor import MachineFinding
from biodance.errors import without_codes
from biodance.pipeline.results import SessionResult
from biodance.records import grouped
from biodance.records.attention import Attention, told_together, without_path
from biodance.report.tables.diagnosis import FIRST, seen_causes
from biodance.report.tables.identification import SEGMENT_ROW, log_in_words
from biodance.report.tables.schema import Row, Schema, shown
from biodance.report.tables.session import TRIAL_ROW
from biodance.report.wording import causes_by_effect, format_number, parted_gain, sizes_in_words, trial_and_subject


class SafeConsole(Console):
    """A terminal that shows what stands in files as text, whatever codes it holds."""

    def render_str(self, text: str, **how: Any) -> Text:  # type: ignore[override]
        """Return a text with control characters as their codes; what we mark up is none of them."""
        return super().render_str(without_codes(text), **how)


def print_line(console: Console, text: str, *, bold: str = "", then: str = "") -> None:
    """Print a text, in one line however long (a terminal breaks it, a file does not): ``bold`` and ``then`` more."""
    console.print(f"{escape(text)}{bold and f'[bold]{escape(bold)}[/]'}{escape(then)}", soft_wrap=True)


def print_table(
    schema: Schema,
    rows: Iterable[Row],
    console: Console,
    *,
    title: str | None = None,
    only: Iterable[str] | None = None,
) -> None:
    """Print rows as their schema shows them, ``only`` the columns of these headings where they are given."""
    headings = list(schema.columns if only is None else only)
    table = Table(box=None, pad_edge=False, title=title, title_justify="left")
    for heading in headings:
        table.add_column(heading, overflow="fold")
    for row in rows:
        table.add_row(*map(escape, schema.cells(row, headings)))
    console.print(table)


def _inspected_lines(record: Row) -> list[str]:
    """Return the lines under the name of one inspected file: how it was read, markers, plates, masses, warnings."""
    lines = list(record.get("history") or ())
    if record.get("markers"):
        known = record.get("marker_set") or "no known set"
        worn = f"the map of {Path(known).name}" if known.endswith(".toml") else known
        lines.append(
            f"{len(record['markers'])} markers ({worn}), {format_number(record.get('gaps_percent'))} % not seen"
        )
    for plate in record.get("plates") or ():
        load = format_number(plate.get("mean_vertical_n"))
        lines.append(f"{plate.get('name', 'plate')}, TYPE {plate['type']}: {load} N vertical on average")
        lines += [f"  {decision}" for decision in plate.get("decisions", ())]
    if record.get("plates"):
        masses = (record.get("mass_on_plates_kg"), record.get("declared_mass_kg"))
        weighed, told = (mass if mass is None else f"{format_number(mass, 2)} kg" for mass in masses)
        lines.append(f"mass on the plates {weighed or 'not known, nobody stands still'}; declared {told or 'none'}")
    return lines + [f"look: {warning}" for warning in record.get("warnings") or ()]


def print_inspected(records: Sequence[Row], console: Console) -> None:
    """Print what `biodance inspect` read of every file."""
    for record in records:
        facts, lines = "", [without_path(str(record.get("reason")), str(record["file"]))]
        if record["status"] != "refused":
            marker, analog = (format_number(record.get(key), 0) for key in ("rate_hz", "analog_rate_hz"))
            facts = f" {record.get('format') or ''}, {record.get('frames') or 0} frames, {marker} / {analog} Hz"
            lines = _inspected_lines(record)
        print_line(console, "", bold=str(record["file"]), then=f": {record['status']}{facts}")
        for line in lines:
            print_line(console, f"  {line}")


_PLACE = Schema("", shown="label: {label} | landmark or segment: {place:name}")


def print_initialised(found: Row, console: Console) -> None:
    """Print what `biodance init` wrote: the subject, the roles and the map of the markers, guesses marked as such."""
    subject = found["subject"]
    names = {"mass_kg": "mass", "height_m": "stature", "sex": "sex", "age": "age"}
    said = ", ".join(
        f"{key} not known"
        if subject[key] is None
        else f"{key} {subject[key]}{' (guessed)' if name in subject['guessed'] else ''}"
        for key, name in names.items()
    )
    print_line(console, f"subject: {said}")
    for trial in found["trials"]:
        print_line(console, f"{trial['name']}: {trial['role']}, {trial['why']}")
    none = "no known set, and none could be guessed: complete the map in the file" if found["markers"] else "none"
    print_line(console, f"markers: {found['marker_set'] or none}")
    if found["marker_map"]:
        print_table(_PLACE, ({"label": a, "place": b} for a, b in found["marker_map"].items()), console)
        console.print("Confirm or correct this map: a wrong one is worse than none.")
    for file, reason in found["refused"].items():
        print_line(console, f"look: {file}: {reason}")
    print_line(console, f"written: {found['file']}")


def print_attention(found: Sequence[Row], console: Console) -> None:
    """Print what a person must see: the verdict's sentence, then the others with their place, strongest first."""
    records = [Attention(row["level"], row["text"], row["trial"], row["about"]) for row in found]
    for one in sorted(told_together(records), key=lambda one: one.about != ABOUT):
        if one.about == ABOUT:
            print_line(console, "", bold=one.text)
        else:
            start = "note" if one.level == "note" else "look"
            print_line(console, f"{start}: ", bold=trial_and_subject(one), then=f": {one.text}")


def print_session(result: SessionResult, found: Row, console: Console) -> None:
    """Print all that needs a person, then one line a trial."""
    print_attention(found["attention"], console)
    rows = TRIAL_ROW.rows(result.trials)
    for row in rows:
        if row["role"] == "static" and row["wrench"]:
            # who stands still presses evenly: there is nothing to correlate but noise
            row["wrench"]["table"]["cc"] = [None] * 6
    print_table(TRIAL_ROW, rows, console)
    if danced := (found.get("identification") or {}).get("performance"):
        _print_performance(danced, console)
    if "accepted" in found:
        _print_accepted(found["accepted"], console)


_MASSES = ("segment", "mass (kg)", "table (kg)", "from the data")
"""Columns of the segments that fit onto a terminal."""


def print_identification(found: Row, console: Console) -> None:
    """Print one line a segment, the validation, the added mass and the notes of `biodance identify`."""
    print_attention(found["attention"], console)
    if found["segments"]:
        print_table(SEGMENT_ROW, found["segments"], console, only=_MASSES)
    for row in found["validation"]:
        table, own = (" ".join(format_number(x) for x in row[name]["rms"]) for name in ("table", "identified"))
        print_line(console, f"{row['trial']}, RMS Fx Fy Fz Mx My Mz: table {table}, identified {own}")
        print_line(console, f"{row['trial']}: {parted_gain(row['gain'])}")
    print_line(console, f"added mass: {found['added_mass_search']['text']}")
    if found["performance"]:
        _print_performance(found["performance"], console)
    for note in found["notes"]:
        print_line(console, f"note: {note}")


def _print_performance(found: Row, console: Console) -> None:
    """Print how well a dance was danced, and which transitions to dance once more."""
    print_line(console, f"dance {found['dance']}, share of the table's variance removed, reached (planned):")
    for row in found["excitation"]:
        print_line(console, shown(f"  {spaced(row['segment'])}: {{reached:%0}} % ({{planned:%0}} %)", row))
    for row in found["logs"]:
        print_line(console, f"log: {log_in_words(row)}")
    for row in found["repetitions"]:
        cues = f"repeat: cue {row['transition']} to {row['transition'] + 1}"
        print_line(console, shown(f"{cues} (+{{gain:%2}} % in the mean, most in {spaced(row['most'])})", row))


def print_foresight(found: Row, console: Console) -> None:
    """Print of `biodance foresee` what a movement will see, confuse and not see, and what to change first."""
    for sentence in filter(None, (found["summary"], found["learned"], found["plates"], found["care"])):
        print_line(console, sentence)
    print_line(console, f"will see: {causes_by_effect(seen_causes(found)) or 'nothing of what it looks for'}")
    hidden = causes_by_effect((row["effect"], row["target"]) for row in found["unobservable"])
    print_line(console, f"cannot see: {hidden or 'nothing of what it looks for'}")
    for pair in found["confusions"]:
        if pair["log_bayes_factor"] is None or pair["log_bayes_factor"] < 3:
            print_line(console, f"will confuse: {cause_in_words(pair['cause'])} with {cause_in_words(pair['other'])}")
    for one in found["changes"][:FIRST]:
        count = len({*one["unseen"], *one["confused"]})
        print_line(console, f"to change: {one['do']} ({count} cause{'s' * (count != 1)})")
    print_line(console, "Every cause and change: --out PAGE.html, or --json.")


def _print_accepted(found: Row, console: Console) -> None:
    """Print what accepting the findings has written for the next session."""
    for what in found["corrections"]:
        print_line(console, f"accepted: {what}")
    for what in found["not_in_recordings"]:
        print_line(console, f"accepted in the body only, no recording is corrected: {what}")
    for one in found["not_applied"]:
        print_line(console, f"not applied: {one['cause']}, because {one['why']}")
    for one in found["written"]:
        print_line(console, f"written: {one['file']} ({one['what']})")
    if not found["written"]:
        print_line(console, "written: nothing")
    for why in found["refused"]:
        print_line(console, f"look: {why}")


def print_diagnosis(found: Row, console: Console) -> None:
    """Print of `biodance diagnose`: headline, what was found with size and interval, what was judged, what is left."""
    print_attention(found["attention"], console)
    for what, cause in found["failures"].items():
        print_line(console, "look: ", bold=f"not solved, {what}", then=f": {cause}")
    beside = " beside the others" if len(found["findings"]) > 1 else ""
    for finding in found["findings"]:
        name, sizes = cause_in_words(finding["effect"], finding["target"]), sizes_in_words(finding["parameters"])
        others = ", ".join(cause_in_words(other["effect"], other["target"]) for other in finding["set"][1:])
        told = f": {sizes}" * bool(sizes) + f"; it could also be: {others}" * bool(others)
        print_line(console, "found: ", bold=name, then=told)
        if finding["gain"]:
            low, high = (100 * x for x in finding["gain"]["ci95"])
            gain = f"removes {low:.0f} to {high:.0f} % of the difference on trials not used"
            print_line(console, f"  accepting it{beside} {gain}")
        print_line(console, f"  {finding['advice']}")
    for worst in [row for row in found["adequacy"] if row["matters"] and row["z"] > LIMIT][:1]:
        low, high = worst["band_hz"]
        where = f"{worst['channel']}, {low:g} to {high:g} Hz, trial {worst['trial']}"
        print_line(console, f"left unexplained: {where} ({worst['z']:.0f} times what sessions without fault vary)")
    _print_judged(found["judged"], console)
    if found["witnesses"]:  # how many causes observations respond to
        seen = sum(bool(row["witnesses"]) for row in found["witness_table"])
        text = f"feet, clocks and empty plates would show {seen} causes and {len(found['witness_table']) - seen} not: "
        print_line(console, f"{text}how small, and what looks like what, stands in the page and in results.json")
    for note in found["notes"]:
        print_line(console, f"note: {note}")
    if "accepted" in found:
        _print_accepted(found["accepted"], console)


def _print_judged(rows: Sequence[Row], console: Console) -> None:
    """Print what was judged, and of what was not why: one line for all trials of one reason."""
    seconds = ", ".join(shown("{trial} {seconds:1} s", row) for row in rows if row["seconds"])
    print_line(console, f"judged: {seconds or 'nothing'}")
    why = grouped((without_path(row["why_not"], row["trial"]), row["trial"]) for row in rows if row["why_not"])
    for reason, trials in why.items():
        print_line(console, f"  {', '.join(trials)}: {reason}")


_PART = Schema(
    "name text",
    {"state": lambda one: "ok" if one.works else "MISSING" if one.needed else "not here (optional)"},
    "part: {name} | state: {state} | what: {text}",
)


def print_findings(findings: Sequence[MachineFinding], console: Console) -> None:
    """Print one line a finding of the doctor."""
    print_table(_PART, _PART.rows(findings), console)
