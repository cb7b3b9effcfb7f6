"""What a window computes in a process of its own: ``python -m biodance.app.tasks TASK ARGUMENTS`` prints JSON."""

import json
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from biodance.app.sessions import KeyChange, changed_text
from biodance.cycles.cut import gait_cycles, is_left_out, replaced_events
from biodance.cycles.strides import STRIDE_UNITS, mean_values, strides
from biodance.effects import SessionEntry
from biodance.effects.labels_swapped import exchanges
from biodance.errors import BiodanceError
from biodance.lab.session.entries import plate_channels
from biodance.lab.session.file import FILES, read_session_file
from biodance.lab.session.read import read_session
from biodance.library import parse_json
from biodance.motion.kinematics import centre_of_mass
from biodance.motion.soles import soles_from_body
from biodance.pipeline.accepted import CORRECTED
from biodance.pipeline.judged_trials import recorded_of
from biodance.pipeline.results import SessionResult
from biodance.pipeline.saved_results import read_kept
from biodance.pipeline.session import followed
from biodance.records import FootEvent
from biodance.report.tables.schema import plain_values


def residual_rows(before: SessionResult, after: SessionResult) -> list[dict[str, Any]]:
    """Return by ``trial`` the RMS of a session ``before`` and ``after`` a correction, each a list: the six channels of
    measured less simulated wrench (N, N·m; the table's body), and the distance of the markers from the body (mm); None
    = not known.
    """
    rms: list[dict[str, list[float | None]]] = [{}, {}]
    for found, result in zip(rms, (before, after), strict=True):
        for one in result.trials:
            compared = one.comparison is not None and one.comparison.used.any()
            wrench = one.comparison.rms.tolist() if compared and one.comparison else [None] * 6
            if compared or one.fit:
                found[one.name] = [*wrench, 1000 * one.fit.total_rms if one.fit else None]
    return [{"trial": name, "before": one, "after": rms[1][name]} for name, one in rms[0].items() if name in rms[1]]


_Finding = Mapping[str, Any]


def proposed_correction(folder: Path, findings: Sequence[_Finding]) -> dict[str, Any]:
    """Return the ``changes`` of session.toml that take ``findings`` off, as the last run told them, and what they
    change: ``residuals`` as `residual_rows`.

    Raises
    ------
    BiodanceError
        session.toml cannot correct one of them, or it is not found any more.
    """
    before = followed(read_session(folder))  # what segments weigh is asked of neither
    changes = [change for one in findings for change in CORRECTIONS[SessionEntry(one["session_entry"])](before, one)]
    joined = _together(changes)
    with _as_changed(folder, joined) as other:
        after = followed(read_session(other))
    return {"changes": joined, "residuals": residual_rows(before, after)}


def _together(changes: Sequence[KeyChange]) -> list[KeyChange]:
    """Return changes of which each key has one: exchanges of the same recording in one list."""
    found: dict[tuple[str, ...], Any] = {}
    for keys, value in changes:
        known = found.get(tuple(keys))
        found[tuple(keys)] = [*known, *(one for one in value if one not in known)] if known else value
    return [(list(keys), value) for keys, value in found.items()]


def _exchanged_labels(result: SessionResult, finding: _Finding) -> Iterator[KeyChange]:
    """Yield the exchange of two labels in every recording, or part of one, in which they carry each other's names."""
    pair, count, said = tuple(finding["target"].split("/")), 0, read_session_file(result.session.folder)
    recorded = recorded_of(result)
    for trial in result.session.trials:
        spans = recorded.once(exchanges).get(trial.name, {}).get(pair, ())
        if not spans or trial.markers is None:
            continue
        count += 1
        time, stem = trial.markers.time, trial.source.path.stem
        ends: list[Sequence[float]] = [
            () if stop - start == time.size else time[[start, stop - 1]].round(4).tolist() for start, stop in spans
        ]
        new = [[*pair, *span] for span in ends]
        yield ["trials", stem, "exchange"], [*(one.entry for one in said.parts(stem).exchanges), *new]
    if not count:
        raise BiodanceError(f"{' and '.join(pair)} carry each other's names no more. Run the session again.")


def _exchanged_plates(result: SessionResult, finding: _Finding) -> Iterator[KeyChange]:
    """Yield the channels of two plates, each under the name of the other."""
    names = finding["target"].split("/")
    if finding["trials"]:
        raise BiodanceError(
            f"{' and '.join(names)}: session.toml describes plates for all recordings alike, and they are exchanged in "
            f"{', '.join(finding['trials'])} alone. Accept the correction: it writes copies."
        )
    of = next((trial for trial in result.session.trials if set(names) <= {one.name for one in trial.plates}), None)
    if of is None:
        raise BiodanceError(f"{' and '.join(names)}: no recording has both plates now. Run the session again.")
    for name, other in zip(names, reversed(names), strict=True):
        labels, _ = plate_channels(next(one for one in of.plates if one.name == other), of)
        if not labels:
            raise BiodanceError(f"{other}: its channels have no names. Accept the correction: it writes copies.")
        yield ["plates", name, "channels"], list(labels)


def _weighed_mass(result: SessionResult, finding: _Finding) -> Iterator[KeyChange]:
    """Yield the mass as the plates have it, without devices."""
    error, person = finding["parameters"]["error"]["value"], result.session.subject
    yield ["subject", "mass_kg"], round(person.mass - sum(person.devices.values()) + error, 1)


CORRECTIONS: Mapping[SessionEntry, Callable[[SessionResult, _Finding], Iterator[KeyChange]]] = {
    SessionEntry.EXCHANGE: _exchanged_labels,
    SessionEntry.CHANNELS: _exchanged_plates,
    SessionEntry.MASS: _weighed_mass,
}
"""What of session.toml takes a finding off -> the changes of it."""


@contextmanager
def _as_changed(folder: Path, changes: Sequence[KeyChange]) -> Iterator[Path]:
    """Yield a folder with links to all that a session holds and session.toml changed; it is gone afterwards."""
    folder, own = folder.resolve(), "session.toml"
    with tempfile.TemporaryDirectory(prefix="biodance-") as place:
        other = Path(place) / folder.name
        other.mkdir()
        links = [(one, other) for one in folder.iterdir() if one.name != own]
        links += [(folder.parent / name, Path(place)) for name in FILES if (folder.parent / name).is_file()]
        for one, where in links:
            (where / one.name).symlink_to(one)
        text = (folder / own).read_text(encoding="utf-8-sig") if (folder / own).is_file() else ""
        (other / own).write_text(changed_text(text, changes), encoding="utf-8")
        yield other


_OF_MASSES = ("margin_aside", "margin_ahead", "vertical_stiffness")
"""Values that rest on masses: the body that is kept has identified ones, the last run's values those of the table."""


def stride_rows(results: Path, session: Path, trial: str, stem: str) -> list[dict[str, Any]]:
    """Return the spatio-temporal values of a ``trial`` (file ``stem``), but `_OF_MASSES`, by ``quantity``, ``unit`` and
    ``side``: ``before``, the mean of the last run, in ``results``, and ``after`` over ``count`` strides, with the
    events and the spans left out that the session.toml of the ``session`` says now; None = no value.

    Raises
    ------
    BiodanceError
        The last run gave no motion of the trial, or found the events of a foot by hand that session.toml says no more.
    """
    document = parse_json((results / "results.json").read_text(encoding="utf-8"))
    moved = [one for one in (document["movement"] or {"trials": []})["trials"] if one["trial"] == trial]
    kept = read_kept(results)
    if not moved or trial not in kept.motions:
        raise BiodanceError(f"Trial {trial}: the last run gave no motion of it. Run the session again.")
    told = read_session_file(session).parts(stem)
    found = tuple(FootEvent(e["time_s"], e["side"], e["down"], e["source"]) for e in moved[0]["events"])
    gone = {one.side for one in found if one.source == "hand"} - {one.side for one in told.events}
    if gone:
        raise BiodanceError(
            f"Trial {trial}: in the last run the events of the {' and '.join(sorted(gone))} foot were set by hand, and "
            f"now they are not. Run the session again to have them found."
        )
    motion, events = kept.motions[trial], replaced_events(found, told.events)
    cycles = [one for one in gait_cycles(trial, events) if not is_left_out(one, told.left_out)]
    soles, centre = soles_from_body(kept.body, motion), centre_of_mass(kept.body, motion)
    some = strides(cycles, events, kept.body, soles, centre)
    before = {(one["quantity"], one["side"]): one["mean"] for one in moved[0]["spatiotemporal"]}
    after = {side: mean_values(some, side) for side in ("left", "right")}
    return [
        {"quantity": name, "unit": unit, "side": side, "before": before.get((name, side))}
        | dict(zip(("after", "sd", "count"), after[side].get(name, (None, None, 0)), strict=True))
        for name, unit in STRIDE_UNITS.items()
        if name not in _OF_MASSES
        for side in ("left", "right")
        if (name, side) in before or name in after[side]
    ]


def _residuals(session: str, accepted: str) -> list[dict[str, Any]]:
    """Return the rows of a session and of its copy in what acceptance wrote; none without a copy."""
    corrected = Path(accepted) / CORRECTED
    if not corrected.is_dir():
        return []
    return residual_rows(*(followed(read_session(folder)) for folder in (Path(session), corrected)))


TASKS: Mapping[str, Callable[..., Any]] = {
    "residuals": _residuals,
    "correction": lambda session, findings: proposed_correction(Path(session), parse_json(findings)),
    "strides": lambda results, session, trial, stem: stride_rows(Path(results), Path(session), trial, stem),
}
"""What can be asked for, by name, with its arguments as texts."""


if __name__ == "__main__":
    try:
        told = TASKS[sys.argv[1]](*sys.argv[2:])
    except BiodanceError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(2)
    sys.stdout.write(json.dumps(plain_values(told)))
