"""What the commands print for a person: short tables on the terminal."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from biodance.diagnosis.consequence import LIMIT
from biodance.diagnosis.diagnosis import ABOUT
from biodance.doctor import MachineFinding
from biodance.errors import without_codes
from biodance.pipeline.results import SessionResult
from biodance.records.attention import Attention, told_together, without_path
from biodance.report.wording import (
    causes_by_effect,
    format_number,
    millimetres,
    named,
    size_seen,
    sizes_in_words,
    trial_and_subject,
)


class SafeConsole(Console):
    """A terminal that shows what stands in files as text, whatever codes it holds."""

    def render_str(self, text: str, **how: Any) -> Text:  # type: ignore[override]
        """Return a text with control characters as their codes; what we mark up is none of them."""
        return super().render_str(without_codes(text), **how)


def _line(console: Console, text: str) -> None:
    """Print a text as it is, in one line however long: a terminal breaks it, a file does not."""
    console.print(escape(text), soft_wrap=True)


def _inspected_lines(record: dict[str, Any]) -> list[str]:
    """Return the lines under the name of one inspected file: how it was read, markers, plates, masses, warnings."""
    lines = list(record.get("history") or ())
    if record.get("markers"):
        known = record.get("marker_set") or "no known set"
        worn = f"the map of {Path(known).name}" if known.endswith(".toml") else known
        lines.append(
            f"{len(record['markers'])} markers ({worn}), {format_number(record.get('gaps_percent'))} % not seen"
        )
    for plate in record.get("plates") or ():
        lines.append(
            f"{plate.get('name', 'plate')}, TYPE {plate['type']}: {format_number(plate.get('mean_vertical_n'))} N "
            f"vertical on average"
        )
        lines += [f"  {decision}" for decision in plate.get("decisions", ())]
    if record.get("plates"):
        on_plates, declared = (record.get("mass_on_plates_kg"), record.get("declared_mass_kg"))
        weighed = "not known, nobody stands still" if on_plates is None else f"{format_number(on_plates, 2)} kg"
        told = "none" if declared is None else f"{format_number(declared, 2)} kg"
        lines.append(f"mass on the plates {weighed}; declared {told}")
    return lines + [f"look: {warning}" for warning in record.get("warnings") or ()]


def print_inspected(records: Sequence[dict[str, Any]], console: Console) -> None:
    """Print what `biodance inspect` read of every file."""
    for record in records:
        rates = (
            f"{record.get('frames') or 0} frames, {format_number(record.get('rate_hz'), 0)} / "
            f"{format_number(record.get('analog_rate_hz'), 0)} Hz"
        )
        facts = f" {record.get('format') or ''}, {rates}" if record["status"] != "refused" else ""
        console.print(f"[bold]{escape(str(record['file']))}[/]: {record['status']}{escape(facts)}", soft_wrap=True)
        lines = (
            _inspected_lines(record)
            if record["status"] != "refused"
            else [without_path(str(record.get("reason")), str(record["file"]))]
        )
        for line in lines:
            _line(console, f"  {line}")


def print_initialised(found: dict[str, Any], console: Console) -> None:
    """Print what `biodance init` wrote: the subject, the roles and the map of the markers, guesses marked as such."""
    subject = found["subject"]
    names = {"mass_kg": "mass", "height_m": "stature", "sex": "sex", "age": "age"}
    said = ", ".join(
        f"{key} {'not known' if subject[key] is None else subject[key]}"
        + (" (guessed)" if subject[key] is not None and name in subject["guessed"] else "")
        for key, name in names.items()
    )
    _line(console, f"subject: {said}")
    for trial in found["trials"]:
        _line(console, f"{trial['name']}: {trial['role']}, {trial['why']}")
    none = "no known set, and none could be guessed: complete the map in the file" if found["markers"] else "none"
    _line(console, f"markers: {found['marker_set'] or none}")
    if found["marker_map"]:
        table = Table("label", "landmark or segment", box=None)
        for label, place in found["marker_map"].items():
            table.add_row(escape(label), place.replace("_", " "))
        console.print(table)
        console.print("Confirm or correct this map: a wrong one is worse than none.")
    for file, reason in found["refused"].items():
        _line(console, f"look: {file}: {reason}")
    _line(console, f"written: {found['file']}")


def print_attention(found: Sequence[dict[str, Any]], console: Console) -> None:
    """Print what a person must see: the verdict's sentence, then the others with their place, strongest first."""
    records = [Attention(row["level"], row["text"], row["trial"], row["about"]) for row in found]
    for one in sorted(told_together(records), key=lambda one: one.about != ABOUT):
        if one.about == ABOUT:
            console.print(f"[bold]{escape(one.text)}[/]", soft_wrap=True)
        else:
            start = "note" if one.level == "note" else "look"
            console.print(f"{start}: [bold]{escape(trial_and_subject(one))}[/]: {escape(one.text)}", soft_wrap=True)


def print_session(result: SessionResult, found: dict[str, Any], console: Console) -> None:
    """Print all that needs a person, then one line a trial."""
    print_attention(found["attention"], console)
    table = Table(box=None, pad_edge=False)
    for heading in ("trial", "role", "state", "markers RMS", "frames", "Fz RMS", "Fz cc"):
        table.add_column(heading, overflow="fold")
    for trial in result.trials:
        rms = f"{millimetres(trial.fit.total_rms)} mm" if trial.fit else "–"
        c = trial.comparison
        wrench = ["–", "–", "–"]
        if c:
            # who stands still presses evenly: there is nothing to correlate but noise
            alike = "–" if trial.trial.role == "static" else format_number(float(c.correlation[2]), 3)
            wrench = [str(int(c.used.sum())), f"{format_number(float(c.rms[2]))} N", alike]
        table.add_row(escape(trial.trial.name), trial.trial.role, trial.status, rms, *wrench)
    console.print(table)


def _print_failures(failures: dict[str, str], console: Console) -> None:
    for what, cause in failures.items():
        console.print(f"look: [bold]not solved, {escape(what)}[/]: {escape(cause)}", soft_wrap=True)


def print_identification(found: dict[str, Any], console: Console) -> None:
    """Print one line a segment, the validation, the added mass and the notes of `biodance identify`."""
    print_attention(found["attention"], console)
    table = Table("segment", "mass (kg)", "table (kg)", "from the data", box=None, pad_edge=False)
    for row in found["segments"]:
        mass = f"{format_number(row['mass_kg'], 2)} ± {format_number(row['mass_sd_kg'], 2)}"
        table.add_row(
            row["name"], mass, format_number(row["mass_prior_kg"], 2), f"{format_number(100 * row['information'], 0)} %"
        )
    if found["segments"]:
        console.print(table)
    for row in found["validation"]:
        told = ", ".join(
            f"{name} {' '.join(format_number(x) for x in row[name]['rms'])}" for name in ("table", "identified")
        )
        _line(console, f"{row['trial']}, RMS Fx Fy Fz Mx My Mz: {told}")
    _line(console, f"added mass: {found['added_mass_search']['text']}")
    if found["performance"]:
        _print_performance(found["performance"], console)
    for note in found["notes"]:
        _line(console, f"note: {note}")


def print_robot_diagnosis(found: dict[str, Any], console: Console) -> None:
    """Print what is not as drawn about a robot (`robot_document`): the verdict, causes with size and evidence."""
    print_attention(found["attention"], console)
    console.print(f"verdict: {found['diagnosis']['verdict']}")
    for one in found["diagnosis"]["findings"]:
        size = f"{format_number(one['value'], 4)} ± {format_number(1.96 * one['sd'], 4)} {one['unit']}".rstrip()
        others = f"; it could also be {', '.join(one['not_told_from'])}" if one["not_told_from"] else ""
        text = f"{one['cause'].replace('_', ' ')}, {one['where']}: {size}, {one['evidence_nats']:.0f} nats{others}"
        _line(console, text)


def _print_performance(found: dict[str, Any], console: Console) -> None:
    """Print how well a dance was danced, and which transitions to dance once more."""
    console.print(f"dance {escape(found['dance'])}, share of the table's variance removed, reached (planned):")
    for row in found["excitation"]:
        console.print(f"  {row['segment']}: {100 * row['reached']:.0f} % ({100 * row['planned']:.0f} %)")
    for row in found["repetitions"]:
        console.print(
            f"repeat: cue {row['transition']} to {row['transition'] + 1} (+{100 * row['gain']:.2f} % in the mean, most "
            f"in {row['most']})"
        )


def print_foresight(found: dict[str, Any], console: Console) -> None:
    """Print what a movement will see, what it will confuse, and what it cannot see, of `biodance foresee`."""
    table = Table("cause", "will be seen from", "and told from the others from", "typical", box=None, pad_edge=False)
    for row in found["limits"]:
        cells = (size_seen(row, key) for key in ("limit", "told_from", "typical"))
        table.add_row(escape(f"{row['effect']} {row['target']}".strip()), *cells)
    console.print(table)
    for pair in found["confusions"]:
        if pair["log_bayes_factor"] is None or pair["log_bayes_factor"] < 3:
            console.print(f"will confuse: {escape(pair['cause'])} with {escape(pair['other'])}")
    hidden = causes_by_effect((row["effect"], row["target"]) for row in found["unobservable"])
    _line(console, f"cannot see: {hidden or 'nothing of what it looks for'}")
    for sentence in (found["summary"], found["plates"], found["care"]):
        if sentence:
            _line(console, sentence)
    for one in found["changes"]:
        count = len({*one["unseen"], *one["confused"]})
        console.print(f"to change: {escape(one['do'])} ({count} cause{'s' * (count != 1)})", soft_wrap=True)


def _print_accepted(found: dict[str, Any], console: Console) -> None:
    """Print what accepting the findings has written for the next session."""
    for what in found["corrections"]:
        _line(console, f"accepted: {what}")
    for what in found["not_in_recordings"]:
        _line(console, f"accepted in the body only, no recording is corrected: {what}")
    for one in found["not_applied"]:
        _line(console, f"not applied: {one['cause']}, because {one['why']}")
    for one in found["written"]:
        _line(console, f"written: {one['file']} ({one['what']})")
    if not found["written"]:
        _line(console, "written: nothing")
    for why in found["refused"]:
        _line(console, f"look: {why}")


def print_diagnosis(found: dict[str, Any], console: Console) -> None:
    """Print of `biodance diagnose`: the headline, what was found with size and interval, what was judged, what is
    left.
    """
    print_attention(found["attention"], console)
    _print_failures(found["failures"], console)
    beside = " beside the others" if len(found["findings"]) > 1 else ""
    for finding in found["findings"]:
        others = ", ".join(named(a["effect"], a["target"]) for a in finding["set"][1:])
        told = f"; it could also be: {others}" if others else ""
        name, sizes = named(finding["effect"], finding["target"]), sizes_in_words(finding["parameters"])
        console.print(f"found: [bold]{escape(name)}[/]{escape(f': {sizes}' * bool(sizes) + told)}", soft_wrap=True)
        if finding["gain"]:
            low, high = (100 * x for x in finding["gain"]["ci95"])
            console.print(
                f"  accepting it{beside} removes {low:.0f} to {high:.0f} % of the difference on trials not used",
                soft_wrap=True,
            )
        _line(console, f"  {finding['advice']}")
    for worst in [row for row in found["adequacy"] if row["matters"] and row["z"] > LIMIT][:1]:
        low, high = worst["band_hz"]
        where = f"{worst['channel']}, {low:g} to {high:g} Hz, trial {worst['trial']}"
        console.print(f"left unexplained: {escape(where)} ({worst['z']:.0f} times what sessions without fault vary)")
    _print_judged(found["judged"], console)
    _print_witnesses(found, console)
    for note in found["notes"]:
        _line(console, f"note: {note}")
    if "accepted" in found:
        _print_accepted(found["accepted"], console)


def _print_judged(rows: Sequence[dict[str, Any]], console: Console) -> None:
    """Print what was judged, and of what was not why: one line for all trials of one reason."""
    seconds = ", ".join(f"{row['trial']} {format_number(row['seconds'])} s" for row in rows if row["seconds"])
    _line(console, f"judged: {seconds or 'nothing'}")
    why: dict[str, list[str]] = {}
    for row in rows:
        if row["why_not"]:
            why.setdefault(without_path(row["why_not"], row["trial"]), []).append(row["trial"])
    for reason, trials in why.items():
        _line(console, f"  {', '.join(trials)}: {reason}")


def _print_witnesses(found: dict[str, Any], console: Console) -> None:
    """Print how many causes the observations respond to, and where it stands how well."""
    if not found["witnesses"]:
        return
    seen, blind = (sum(bool(row["witnesses"]) is looked for row in found["witness_table"]) for looked in (True, False))
    text = f"feet, clocks and empty plates would show {seen} causes and {blind} not: how small, and "
    _line(console, f"{text}what looks like what, stands in the page and in results.json")


def print_findings(findings: Sequence[MachineFinding], console: Console) -> None:
    """Print one line a finding of the doctor."""
    table = Table(box=None, pad_edge=False, show_header=False)
    for finding in findings:
        state = "ok" if finding.works else "MISSING" if finding.needed else "not here (optional)"
        table.add_row(finding.name, state, escape(finding.text))
    console.print(table)
