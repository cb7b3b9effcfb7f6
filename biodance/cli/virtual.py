"""Commands of the virtual lab: simulate, demo."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from biodance.cli.app import (
    DONE,
    NOBODY,
    ForceOption,
    OutOption,
    PersonFacts,
    app,
    not_negative,
    progress,
    show_place,
    whole,
)
from biodance.cli.place import put_session_results
from biodance.cli.session import print_reported, report_session


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Drawn:
    """What chance and the user put into a simulated session: the person's own body, how well they copy, the laboratory,
    hidden causes.
    """

    seed: Annotated[
        int,
        Parameter(
            converter=whole,
            validator=not_negative,
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
        tuple[str, ...], Parameter(negative=(), help="Inject a fault, e.g. plate_gain:target=Fz,gain=0.04; repeatable.")
    ] = ()
    lab_seed: Annotated[
        int | None,
        Parameter(
            converter=whole,
            validator=not_negative,
            help="Random seed of the laboratory (plates, cameras, soft tissue, tolerances), 0 or more.",
        ),
    ] = None


@app.command(name="simulate")
def simulate_command(
    *,
    protocol: str | None = None,
    dance: Annotated[
        Path | None,
        Parameter(
            name="--dance",
            help="dance.npz of `biodance dance`, performed instead of a protocol; the person defaults to its own.",
        ),
    ] = None,
    person: PersonFacts = NOBODY,
    drawn: Drawn,
    out: OutOption,
    force: ForceOption = False,
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
    if force:
        _forget_simulated(out)
    with progress() as tell:
        tell(f"simulating {protocol or dance}")
        folder = front_dance.simulate(
            who, protocol, out, seed=drawn.seed, effects=drawn.effect, dance=shown, performer=drawn.performer,
            lab_seed=drawn.lab_seed,
        )  # fmt: skip
    show_place(folder)
    return DONE


@app.command(name="demo")
def demo_command(*, out: OutOption = Path("demo"), force: ForceOption = False) -> int:
    """Simulate a short session with known true values, and report it like a real one."""
    from biodance.lab.session.read import read_session
    from biodance.lab.session.results_folder import results_folder
    from biodance.pipeline.session import examine
    from biodance.records import Subject
    from biodance.virtual_lab.simulate import simulate_session as write_session

    if force:
        _forget_simulated(out / "simulated_session")
    with progress() as tell:
        tell("simulating a session")
        session = write_session(Subject(62.0, 1.70, "F", 31.0), "short", out / "simulated_session", seed=1)
        place = results_folder(out / "report", session, force=force)
        result, found = report_session(examine(read_session(session, tell=tell), tell=tell), place.part, tell)
        folder = put_session_results(place, result.session)
    return print_reported(result, folder, found, False)


def _forget_simulated(folder: Path) -> None:
    """Remove a folder that holds a simulated session and nothing else; leave every other one alone."""
    import shutil

    simulated = (folder / "truth" / "truth.json").is_file() and (folder / "session.toml").is_file()
    if simulated and all(path.suffix == ".c3d" or path.name in ("session.toml", "truth") for path in folder.iterdir()):
        shutil.rmtree(folder)
