"""Commands of the virtual lab: simulate, demo."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from biodance.cli import shared
from biodance.cli.session import print_reported, put_session_results, report_session


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Drawn:
    """What chance and the user put into a simulated session: the person's own body, how well they copy, the laboratory,
    hidden causes.
    """

    seed: Annotated[
        int,
        Parameter(
            converter=shared.whole,
            validator=shared.not_negative,
            help="Random seed, 0 or more; the same seed gives the same person and the same files.",
        ),
    ]
    performer: Annotated[
        Literal["steady", "normal", "restless"],
        Parameter(
            help="Accuracy of the performance: angles within 2, 5 or 7 deg, tempo within 5, 10 or 20 %, and sway."
        ),
    ] = "normal"
    effect: Annotated[
        tuple[str, ...], Parameter(help="Inject a fault, e.g. plate_gain:target=Fz,gain=0.04; repeatable.")
    ] = ()
    lab_seed: Annotated[
        int | None,
        Parameter(
            converter=shared.whole,
            validator=shared.not_negative,
            help="Random seed of the laboratory (plates, cameras, soft tissue, tolerances), 0 or more.",
        ),
    ] = None


@shared.app.command(name="simulate")
def simulate_command(
    *,
    protocol: str | None = None,
    dance: Annotated[
        Path | None,
        Parameter(
            help="dance.npz of `biodance dance`, performed instead of a protocol; the person defaults to its own."
        ),
    ] = None,
    person: shared.PersonFacts = shared.NOBODY,
    drawn: Drawn,
    out: shared.OutOption,
    force: shared.ForceOption = False,
) -> int:
    """Simulate a session: C3D files and session.toml as from a real laboratory, and the true values in truth/.

    Parameters
    ----------
    protocol
        Name of a protocol, e.g. dance, short, squat or standing; an unknown name lists all. Exclusive with --dance.
    """
    from biodance.dance.dance import Dance
    from biodance.pipeline import front_dance

    shown = None if dance is None else Dance.load(dance)
    who = front_dance.virtual_subject(shown, sex=person.sex, height=person.height, mass=person.mass, age=person.age)
    with shared.progress() as tell, _simulated_anew(out, force=force) as place:
        tell(f"simulating {protocol or dance}")
        front_dance.simulate(
            who, protocol, place, seed=drawn.seed, effects=drawn.effect, dance=shown, performer=drawn.performer,
            lab_seed=drawn.lab_seed,
        )  # fmt: skip
    shared.show_place(out)
    return shared.DONE


@shared.app.command(name="effects")
def effects_command(name: str | None = None, *, json: shared.JsonOption = False) -> int:
    """List the causes of disagreement that are looked for: parameters with units, and which can be simulated.

    Parameters
    ----------
    name
        One cause only, e.g. added_mass. The values of one are written --effect NAME:target=WHERE,parameter=value.
    """
    from biodance.effects import causes
    from biodance.report.tables.diagnosis import CAUSE_ROW, causes_document, causes_shown
    from biodance.report.terminal import print_table

    document = causes_document(causes(None if name is None else [name]).values())
    shared.show(document, lambda rows, console: print_table(CAUSE_ROW, causes_shown(rows), console), json=json)
    return shared.DONE


@shared.app.command(name="demo")
def demo_command(*, out: shared.OutOption = Path("demo"), force: shared.ForceOption = False) -> int:
    """Simulate a short session with known true values, and report it like a real one."""
    from biodance.lab.session.read import read_session
    from biodance.lab.session.results_folder import results_folder
    from biodance.pipeline.session import followed
    from biodance.records import Subject
    from biodance.virtual_lab.simulate import simulate_session as write_session

    session = out / "simulated_session"
    with shared.progress() as tell:
        tell("simulating a session")
        with _simulated_anew(session, force=force) as fresh:
            write_session(Subject(62.0, 1.70, "F", 31.0), "short", fresh, seed=1)
        place = results_folder(out / "report", session, force=force)
        result, found = report_session(followed(read_session(session, tell=tell), tell=tell), place.part, tell)
        folder = put_session_results(place, result.session)
    return print_reported(result, folder, found, False)


@contextmanager
def _simulated_anew(folder: Path, *, force: bool) -> Iterator[Path]:
    """Yield where to simulate: ``folder``, or with ``force`` a folder that takes its place, whole, where that holds a
    simulated session and nothing else.
    """
    from biodance.lab.session.results_folder import whole_folder

    simulated = (folder / "truth" / "truth.json").is_file() and (folder / "session.toml").is_file()
    ours = all(path.suffix == ".c3d" or path.name in ("session.toml", "truth") for path in folder.glob("*"))
    if not (force and simulated and ours):
        yield folder
        return
    with whole_folder(folder, over=True) as part:
        yield part / "session"
        for path in (part / "session").iterdir():
            path.replace(part / path.name)
        (part / "session").rmdir()
