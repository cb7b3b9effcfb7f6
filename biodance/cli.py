"""The command ``biodance``: parse, call, print. Rooms are imported inside the commands, so that ``--help`` is quick.

Exit codes: 0 done, 1 done but something was refused or needs a person, 2 could not be done (one sentence on stderr), 130 stopped by Ctrl-C.
"""

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, CycloptsError, Parameter

from biodance import __version__

if TYPE_CHECKING:
    from collections.abc import Callable

    from biodance.pipeline.results import SessionResult
    from biodance.records import Session

DONE, NEEDS_A_PERSON, NOT_DONE, STOPPED = 0, 1, 2, 130

app = App(
    name="biodance",
    version=__version__,
    help="Segment inertial parameters of a person, measured from markers and force plates. For research use, not a diagnosis.",
    suppress_keyboard_interrupt=False,
)

Json = Annotated[bool, Parameter(name="--json", negative="", help="Print one JSON document on stdout and nothing else there.")]
Force = Annotated[bool, Parameter(name="--force", negative="", help="Write into a folder that already holds files.")]
Out = Annotated[Path, Parameter(name="--out", help="Folder for the results; it is made if it is missing.")]


def say(sentence: str) -> None:
    """Write one line to stderr."""
    sys.stderr.write(sentence.rstrip() + "\n")


def _print(document: object) -> None:
    from biodance.report.results_json import to_text

    sys.stdout.write(to_text(document))


@contextmanager
def _progress() -> "Iterator[Callable[[str], None]]":
    """Yield a function that shows on stderr what is being done: one changing line on a terminal, nothing elsewhere."""
    from rich.console import Console
    from rich.markup import escape

    with Console(stderr=True).status("") as status:
        yield lambda text: status.update(escape(text))


def _reported(recording: "Session", folder: Path, tell: "Callable[[str], None]") -> "tuple[SessionResult, dict[str, Any]]":
    """Examine a session and report it into ``folder``; return the result and the content of results.json."""
    from biodance.pipeline.session import examine
    from biodance.report.write import write_report

    result = examine(recording, tell=tell)
    tell("writing the page")
    return result, write_report(result, folder)


def _told(result: "SessionResult", folder: Path, found: "dict[str, Any]", json: bool) -> int:
    """Print what was reported and return the exit code."""
    from rich.console import Console

    from biodance.report.terminal import print_session

    if json:
        _print(found)
    else:
        print_session(result, Console())
        sys.stdout.write(f"{folder / 'report.html'}\n")
    if result.stopped:
        say(f"Stopped by Ctrl-C: {folder} holds the trials that were done, and names the others.")
        return STOPPED
    return NEEDS_A_PERSON if result.needs_a_person else DONE


def _told_identified(result: "SessionResult", folder: Path, found: "dict[str, Any]", json: bool) -> int:
    """Print what was identified and return the exit code."""
    from rich.console import Console

    from biodance.report.terminal import print_identification

    if json:
        _print(found)
    else:
        print_identification(found, Console())
        sys.stdout.write(f"{folder / 'report.html'}\n")
    return NEEDS_A_PERSON if result.needs_a_person or found["status"] != "solved" else DONE


def _forget_simulated(folder: Path) -> None:
    """Remove a folder that holds a simulated session and nothing else; leave every other one alone."""
    import shutil

    simulated = (folder / "truth" / "truth.json").is_file() and (folder / "session.toml").is_file()
    if simulated and all(path.suffix == ".c3d" or path.name in ("session.toml", "truth") for path in folder.iterdir()):
        shutil.rmtree(folder)


@app.command
def inspect(*paths: Path, json: Json = False) -> int:
    """Say what is in recordings: markers, gaps, plates, the weight on them, and every decision the readers take.

    Parameters
    ----------
    paths
        Files, or folders whose recordings are all read.
    """
    from rich.console import Console

    from biodance.lab.inspect import inspect_paths
    from biodance.report.terminal import print_inspected

    with _progress() as tell:
        records = inspect_paths(paths, tell=tell)
    if json:
        _print(records)
    else:
        print_inspected(records, Console())
    states = {record["status"] for record in records}
    return NOT_DONE if states == {"refused"} else NEEDS_A_PERSON if states - {"ok"} else DONE


@app.command
def report(session: Path, *, out: Out, subject: str | None = None, json: Json = False, force: Force = False) -> int:
    """Take a session through all stages and write report.html and results.json.

    Parameters
    ----------
    session
        Folder with the static trial and the other trials.
    subject
        The person to report where C3D files hold several; without it a file with several persons is refused and names them.
    """
    from biodance.lab.results_folder import results_folder
    from biodance.lab.session import read_session

    with _progress() as tell:
        recording = read_session(session, subject_name=subject, tell=tell)
        folder = results_folder(out, session, force=force)
        result, found = _reported(recording, folder, tell)
    return _told(result, folder, found, json)


@app.command
def identify(
    session: Path, *, out: Out, reference: Path | None = None, subject: str | None = None, json: Json = False, force: Force = False
) -> int:
    """Identify what every segment weighs, with intervals, validate it on the trials kept, and look for an added mass.

    Parameters
    ----------
    session
        Folder with the static trial and the other trials.
    reference
        An earlier session of the same person without load: a load is then looked for against it instead of the table.
    subject
        The person to identify where C3D files hold several.
    """
    from biodance.lab.results_folder import results_folder
    from biodance.lab.session import read_session
    from biodance.pipeline.session import examine, identified
    from biodance.report.write import write_identification

    with _progress() as tell:
        before = identified(examine(read_session(reference, subject_name=subject, tell=tell), tell=tell)) if reference else None
        recording = read_session(session, subject_name=subject, tell=tell)
        folder = results_folder(out, session, force=force)
        result = examine(recording, reference=before, tell=tell)
        found = identified(result)
        tell("writing the page")
        document = write_identification(result, found, folder)
    return _told_identified(result, folder, document, json)


@app.command
def export(
    source: Path,
    *,
    format: Annotated[str, Parameter(help="osim, urdf, mjcf, biomod, csv; or trc, mot of one trial.")],
    out: Annotated[Path, Parameter(help="The file to write.")],
    trial: Annotated[str | None, Parameter(help="Name of the trial for trc and mot.")] = None,
    subject: Annotated[str | None, Parameter(help="The person to export where C3D files hold several.")] = None,
    force: Annotated[bool, Parameter(name="--force", negative="", help="Replace the file if it exists.")] = False,
) -> int:
    """Write a session, or the results of `biodance identify`, for another program.

    Parameters
    ----------
    source
        Session folder, or folder with the results of `biodance identify`.
    """
    from biodance.pipeline.export import export as write
    from biodance.pipeline.export import replaceable

    with _progress() as tell, replaceable(out, force=force) as place:
        _, sentence = write(source, place, format=format, trial=trial, subject=subject, tell=tell)
    say(sentence)
    sys.stdout.write(f"{out}\n")
    return DONE


@app.command
def simulate(
    *,
    protocol: str,
    sex: Literal["F", "M"],
    height: Annotated[float, Parameter(help="Stature, m.")],
    mass: Annotated[float, Parameter(help="Body mass, kg.")],
    age: Annotated[float, Parameter(help="Age, years.")] = float("nan"),
    seed: Annotated[int, Parameter(help="The same seed gives the same person and the same files.")],
    effect: Annotated[tuple[str, ...], Parameter(negative=(), help="Hide a cause: plate_gain:target=Fz,gain=0.04; may be repeated.")] = (),
    out: Out,
    force: Force = False,
) -> int:
    """Write a simulated session: C3D files and session.toml as a lab would, and the truth apart in truth/truth.json.

    Parameters
    ----------
    protocol
        Name of a protocol: dance, short, squat, standing ...; a wrong name lists all.
    """
    from biodance.records import Subject
    from biodance.virtual_lab.hide import hide, parse
    from biodance.virtual_lab.protocol_file import read_protocol
    from biodance.virtual_lab.simulate import simulate as write_session

    if force:
        _forget_simulated(out)
    with _progress() as tell:
        tell(f"simulating {protocol}")
        subject, plan = Subject(mass, height, sex, age), read_protocol(protocol)
        visit, loads = hide(tuple(parse(text) for text in effect), subject, plan, seed=seed)
        folder = write_session(subject, plan, out, seed=seed, loads=loads, visit=visit)
    sys.stdout.write(f"{folder}\n")
    return DONE


@app.command
def demo(*, out: Out = Path("demo"), force: Force = False) -> int:
    """Simulate a short session of a person whose truth is known, and report it like a real one."""
    from biodance.lab.results_folder import results_folder
    from biodance.lab.session import read_session
    from biodance.records import Subject
    from biodance.virtual_lab.simulate import simulate as write_session

    if force:
        _forget_simulated(out / "simulated_session")
    with _progress() as tell:
        tell("simulating a session")
        session = write_session(Subject(62.0, 1.70, "F", 31.0), "short", out / "simulated_session", seed=1)
        folder = results_folder(out / "report", session, force=force)
        result, found = _reported(read_session(session, tell=tell), folder, tell)
    return _told(result, folder, found, False)


@app.command
def criteria(*, ranges: str = "frontal", json: Json = False) -> int:
    """Compare all excitation criteria on the planar chain: each designs a motion of 2 s, each judges all of them.

    Parameters
    ----------
    ranges
        Assumed joint ranges of the chain: frontal, equal or wide.
    """
    from biodance.body.planar import planar_chain
    from biodance.dance.planar import compared

    body = planar_chain(ranges=ranges)
    with _progress() as tell:
        tell("designing one motion with every criterion")
        found = compared(body)
    if json:
        score = {name: dict(zip(found.names, row, strict=True)) for name, row in zip(found.names, found.score.tolist(), strict=True)}
        _print({"criteria": list(found.names), "score": score, "sd_before": found.sd_before.tolist(), "sd_after": found.sd_after.tolist()})
    else:
        sys.stdout.write(f"{found.table()}\nA row is a design, a column a judge; * is the best of the column; smaller is better.\n")
    return DONE


@app.command
def doctor(*, json: Json = False) -> int:
    """Say what works on this machine, and how to mend what does not."""
    from dataclasses import asdict

    from rich.console import Console

    from biodance.doctor import examine
    from biodance.report.terminal import print_findings

    with _progress() as tell:
        findings = examine(tell=tell)
    if json:
        _print([asdict(finding) for finding in findings])
    else:
        print_findings(findings, Console())
    return DONE if all(finding.works for finding in findings if finding.needed) else NEEDS_A_PERSON


def run(tokens: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; every expected fault is one sentence on stderr."""
    from biodance.errors import BiodanceError

    try:
        return app(tokens, exit_on_error=False, print_error=False, result_action="return_value") or DONE
    except CycloptsError as error:
        say(f"{' '.join(str(error).split())} See biodance --help.")
    except BiodanceError as error:
        say(str(error))
    except OSError as error:
        say(f"{error.filename or 'biodance'}: {error.strerror or error}.")
    except Exception as error:
        if "BIODANCE_TRACEBACK" in os.environ:
            raise
        say(f"biodance itself failed ({type(error).__name__}: {error}). Please report this; BIODANCE_TRACEBACK=1 shows where.")
    except KeyboardInterrupt:
        say("Stopped before the command was done; what was already written is complete.")
        return STOPPED
    return NOT_DONE


def main() -> None:
    """Run the command line and leave with its exit code."""
    sys.exit(run())
