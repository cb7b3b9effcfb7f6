"""All sessions of an archive in one table and on one page."""

from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np

from biodance.batch.work import ROW_TYPES, Outcome
from biodance.diagnosis.archive.alike import SessionLeft, likenesses
from biodance.display import BLUE, RED
from biodance.errors import FileRefused
from biodance.lab.plain_text import whole_file
from biodance.lab.session.results_folder import read_manifest
from biodance.library import parse_json
from biodance.report.files import csv_text, write_files

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

_PAGE = "report.html"
SESSIONS = "sessions"
"""Folder of the sessions' own results, in that of the archive's."""
_FAR = 3.0
"""Robust standard deviations from the archive's median at which a session stands out."""
_KEY = {
    "mass_difference_percent": ("mass on the plates against declared", "%", 1.0),
    "marker_rms_m": ("distance of markers", "mm", 1e3),
    "fz_rms_table_n": ("vertical force against the table's body", "N", 1.0),
}


def folder_name(session: str) -> str:
    """Return the folder of a session's results: one level, so that a session inside another one keeps its own."""
    return quote(session, safe=" ")


def summary_table(outcomes: Sequence[Outcome]) -> "pd.DataFrame":
    """Return one row for each trial of every session; a session that was not read has one row with its reason."""
    import pandas as pd

    rows = []
    for one in outcomes:
        about = {"session": one.name, "session_status": one.status, "seconds": one.seconds, "memory_mb": one.memory_mb}
        for row in one.rows or ({"trial": "", "status": one.status, "reason": one.reason},):
            rows.append({**row, **about, "reason": row.get("reason") or ""})
    return pd.DataFrame(rows, columns=list(ROW_TYPES)).astype(ROW_TYPES)


def write_summary(folder: Path, name: str, outcomes: Sequence[Outcome], left_out: Sequence[str] = ()) -> None:
    """Write ``summary.parquet``, ``summary.csv`` and ``report.html`` of an archive over an earlier summary."""
    table = summary_table(outcomes)
    with whole_file(folder / "summary.parquet", over=True) as part:
        table.to_parquet(part, index=False)
    alike = [one.text for one in likenesses(left_in_archive(folder, [one.name for one in outcomes]))]
    pages = {one.name: f"{SESSIONS}/{folder_name(one.name)}/{_PAGE}" for one in outcomes}
    links = {name: quote(page) for name, page in pages.items() if (folder / page).is_file()}
    twice = same_recordings(folder, [one.name for one in outcomes])
    page = _page(name, outcomes, table, left_out, links, alike, twice)
    write_files(folder, {"summary.csv": csv_text(table), _PAGE: page})


def outliers(table: "pd.DataFrame") -> "list[dict[str, Any]]":
    """Return each session's worst trial by quantity, beyond `_FAR` robust sd (MAD) of at least eight sessions."""
    found = []
    for column, (what, unit, factor) in _KEY.items():
        known = table[["session", "trial", column]].dropna()
        if known["session"].nunique() < 8:
            continue
        value = known[column].to_numpy() * factor
        middle = float(np.median(value))
        # 1.4826 times the median absolute deviation is the sd of normal values
        spread = 1.4826 * float(np.median(np.abs(value - middle)))
        far = known.assign(value=value, away=np.abs(value - middle) / max(spread, 1e-12))
        worst = far[far["away"] > _FAR].sort_values("away", ascending=False).drop_duplicates("session")
        usual = f"{middle:.1f} ± {spread:.1f} {unit}"
        for one in worst.itertuples():
            far_off = f"{one.value:.1f} {unit}"
            found.append({"session": one.session, "trial": one.trial, "what": what, "value": far_off, "usual": usual})
    return found


def left_in_archive(folder: Path, names: Iterable[str]) -> tuple[SessionLeft, ...]:
    """Return what is left of those sessions ``names`` in an archive's ``folder`` that were diagnosed."""
    found = []
    for name in names:
        path = folder / SESSIONS / folder_name(name) / "results.json"
        try:
            document = parse_json(path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            continue  # without results, or damaged since: `biodance verify` says it, and the next run does it again
        one = document.get("diagnosis") or {}
        left = {(row["channel"], tuple(row["band_hz"])): float(row["z"]) for row in one.get("adequacy") or ()}
        if left:
            plates = frozenset(plate["name"] for trial in document["trials"] for plate in trial["plates"])
            found.append(SessionLeft(name, plates, left, told=one["verdict"] in ("nothing wrong", "named, complete")))
    return tuple(found)


def same_recordings(folder: Path, names: Iterable[str]) -> list[tuple[str, ...]]:
    """Return which of the sessions ``names`` in an archive's ``folder`` hold the same recordings, by their SHA-256."""
    found: dict[frozenset[str], list[str]] = {}
    for name in names:
        with suppress(FileRefused):  # damaged since: `biodance verify` says it
            manifest = read_manifest(folder / SESSIONS / folder_name(name))
            held = (
                {file: sha for file, sha in manifest.inputs.items() if not file.endswith(".toml")} if manifest else {}
            )
            found.setdefault(frozenset(held.values()), []).append(name)
    return [tuple(some) for held, some in found.items() if held and len(some) > 1]


def _figure(table: "pd.DataFrame") -> "Figure | None":
    """Draw the key figures of all sessions as histograms; None where there is nothing to draw."""
    from biodance.report.figures.style import figure, look

    shown = {name: table.dropna(subset=[name]).groupby("session")[name].median() for name in _KEY}
    shown = {name: found for name, found in shown.items() if len(found) > 1}
    if not shown:
        return None
    with look():
        drawn = figure(2.2)
        for axes, (name, found) in zip(np.atleast_1d(drawn.subplots(1, len(shown))), shown.items(), strict=True):
            what, unit, factor = _KEY[name]
            axes.hist(found.to_numpy() * factor, bins=min(30, max(5, len(found) // 2)), color=BLUE)
            axes.axvline(float(np.median(found)) * factor, color=RED, linewidth=1)
            axes.set(xlabel=fill(f"{what}, {unit}", 26), ylabel="sessions")
            axes.yaxis.get_major_locator().set_params(integer=True)
    return drawn


def _page(
    name: str,
    outcomes: Sequence[Outcome],
    table: "pd.DataFrame",
    left_out: Sequence[str],
    links: dict[str, str],
    alike: Sequence[str] = (),
    twice: Sequence[tuple[str, ...]] = (),
) -> str:
    """Return the page of an archive as HTML text."""
    from markupsafe import Markup

    from biodance.pipeline.saved_results import now
    from biodance.report.figures.style import svg_address
    from biodance.report.pages.template import print_sheet, render, template_text
    from biodance.report.wording import IN_SHORT, signed

    drawn, made = _figure(table), now()
    first = table.drop_duplicates("session").set_index("session")
    verdicts = first["verdict"].dropna().replace(IN_SHORT)
    return render(
        "archive.html.j2",
        filters={"signed": signed},
        style=Markup(template_text("page.css")) + print_sheet(name, {}, made),
        name=name,
        created=made,
        outcomes=outcomes,
        unread=[one for one in outcomes if one.unread],
        counts=dict(sorted(Counter(one.status for one in outcomes).items())),
        verdicts=verdicts.value_counts().to_dict(),
        findings=first.loc[first["findings"].fillna("") != "", "findings"].to_dict(),
        mass=first["mass_difference_percent"].dropna().to_dict(),
        verdict=verdicts.to_dict(),
        strange=outliers(table),
        alike=alike,
        twice=twice,
        figure=svg_address(drawn) if drawn else "",
        left_out=left_out,
        trials=len(table),
        seconds=sum(one.seconds for one in outcomes),
        memory=max((one.memory_mb for one in outcomes), default=0.0),
        links=links,
    )
