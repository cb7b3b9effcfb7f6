"""Commands before a visit: dances to be recorded (dance, limits, feedback, play), simulated ones (simulate, demo)."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from biodance.cli import shared
from biodance.cli.session import print_reported, put_session, report_session
from biodance.errors import BiodanceError, refuse_unknown

if TYPE_CHECKING:
    from biodance.dance.problem.plan import Plan
    from biodance.records import Subject


FileOut = Annotated[Path, Parameter(help="Output file, e.g. dance.html.")]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class LeadingOptions:
    """What leads a person through a dance, and whether at all."""

    despite: Annotated[
        bool,
        Parameter(help="Write cards or page of a dance that is NOT SAFE when imprecise all the same; they say so."),
    ] = False
    language: Annotated[
        str, Parameter(help="Language of cards and page: en, de, or the path of a catalogue of your own (*.po).")
    ] = "en"


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class DanceAsked:
    """What is to be danced, within which limits and where."""

    protocol: Annotated[
        str, Parameter(help="Built-in protocol (easy, patient, chair, short, one_segment, full) or a TOML file.")
    ] = "full"
    limits: Annotated[
        Path | None,
        Parameter(help="TOML file with what the person can and may do; `biodance limits` writes one to begin with."),
    ] = None
    plate: Annotated[
        str | None,
        Parameter(help="Force plate, m from side to side and ahead as the person faces, e.g. 0.40,0.60 (usual)."),
    ] = None

    def plan(self) -> "Plan":
        """Return the plan of the protocol, for the plate if one was named."""
        from biodance.dance.problem.plan import read_plan

        plan = read_plan(self.protocol)
        return plan if self.plate is None else replace(plan, plate=_sides(self.plate))


USUAL_DANCE, USUAL_LEADING = DanceAsked(), LeadingOptions()


@shared.app.command(name="dance", group=shared.DANCES)
def dance_command(
    *,
    asked: DanceAsked = USUAL_DANCE,
    person: shared.PersonFacts = shared.NOBODY,
    robot: shared.RobotFile = shared.NO_ROBOT,
    seed: Annotated[
        int,
        Parameter(
            converter=shared.whole,
            validator=shared.not_negative,
            help="Random seed, 0 or more; the same seed gives the same dance.",
        ),
    ] = 0,
    leading: LeadingOptions = USUAL_LEADING,
    out: shared.OutOption,
    json: shared.JsonOption = False,
    force: shared.ForceOption = False,
) -> int:
    """Design a dance (exciting motion) for one person or robot: safe, balanced and informative about every segment.

    Writes dance.npz, dance.c3d (a person's virtual markers) or dance.csv (a robot's joint angles), cues.md, cues.html
    (printable cards), margins.md, figures and results.json. Ctrl-C keeps finished parts; the same command resumes from
    there. If no dance satisfies all limits, the violated limit is reported. What leads a person (cards, cues,
    dance.c3d) is not written of a dance that is NOT SAFE when imprecise, unless --despite is given. The exit code is 1
    where somebody must act: there is no dance, it is NOT SAFE, or a limit of the person's file had to be widened.
    """
    from biodance.dance.problem.person import HEALTHY, read_person
    from biodance.lab.session.results_folder import whole_folder
    from biodance.pipeline.dance import UNFINISHED, dance_folder, dancer, make_dance, robot_dancer
    from biodance.report.dance import print_dance, write_dance
    from biodance.report.pages.language import read_language

    if robot.given and asked.plate is not None:
        raise BiodanceError("--plate is for people: a robot's feet stand as far apart as its hips. Leave it out.")
    read_language(leading.language)  # what is wrong with it is said before the long work starts
    plan, able = asked.plan(), read_person(asked.limits) if asked.limits else HEALTHY
    who = _who(person, robot)
    if isinstance(who, shared.RobotFile):
        body, subject = robot_dancer(*who.named(), mend=who.mend), None
    else:
        body, subject = dancer(who, plan), who
    folder = dance_folder(out, force=force)
    with counted_progress() as tell:
        try:
            unfinished = folder / UNFINISHED
            result = make_dance(body, plan, able, subject=subject, seed=seed, tell=tell, resume=unfinished)
        except KeyboardInterrupt:
            shared.say(f"Stopped; {folder} keeps what is finished. The same command goes on from there.")
            return shared.STOPPED
        tell("writing", 0, 0)
        with whole_folder(folder, over=True) as part:
            found = write_dance(result, part, despite=leading.despite, language=leading.language)
    shared.show(found, print_dance, json=json, path=folder)
    if result.dance is not None and result.dance.unsafe and not leading.despite:
        shared.say(
            "No cards, cues and dance.c3d: the dance is NOT SAFE when imprecise. --despite writes them all the same."
        )
    if not result.feasible:
        shared.say(f"There is no such dance. {result.reason}")
    return shared.DONE if result.settled else shared.NEEDS_A_PERSON


@shared.app.command(name="limits", group=shared.DANCES)
def limits_command(
    *,
    template: Annotated[
        str, Parameter(help="Whose limits: stroke, hip_tep (a new hip), parkinson, child, old or amputee.")
    ],
    out: Annotated[Path, Parameter(help="Output file, e.g. person.toml.")],
    force: shared.ForceOption = False,
) -> int:
    """Write a commented file of one person's limits, to be changed and given to `biodance dance --limits`."""
    from biodance.lab.plain_text import write_whole
    from biodance.library import folder, names
    from biodance.report.files import refuse_file

    legal = names("protocols/limits")
    refuse_unknown("template of limits", template, legal)
    refuse_file(out, force=force)
    write_whole(out, (folder("protocols") / "limits" / f"{template}.toml").read_bytes(), over=force)
    shared.show_place(out)
    return shared.DONE


@shared.app.command(name="feedback", group=shared.DANCES)
def feedback_command(
    dance: Path,
    *,
    leading: LeadingOptions = USUAL_LEADING,
    out: FileOut,
    force: shared.ForceOption = False,
) -> int:
    """Write a page that guides a person through a dance: one HTML file that opens in a browser without a network.

    It shows the person's own body, the next posture as a light figure, what to move, and a countdown with sound;
    optionally over the mirrored image of a camera. Of a dance that is NOT SAFE when imprecise there is no page, unless
    --despite is given: then it says so on top. With a camera it tracks the person, scores every posture by its
    information about each segment, and asks for the missing ones.

    Parameters
    ----------
    dance
        The dance.npz written by `biodance dance`, or its folder.
    """
    from biodance.dance.dance import Dance
    from biodance.report.pages.feedback import write_feedback

    one = Dance.load(dance)
    if not write_feedback(one, out, force=force, despite=leading.despite, language=leading.language):
        shared.say(
            "The page leads but does not follow: this takes the bundle that `make bundle` builds in a checkout (npm)."
        )
    shared.show_place(out)
    return shared.DONE


@shared.app.command(name="play", group=shared.DANCES)
def play_command(
    dance: Path,
    *,
    out: Annotated[Path, Parameter(help="Output video: .gif, or .mp4 if ffmpeg is installed.")],
    hold: Annotated[float, Parameter(help="Longest time a posture is held, s.")] = 0.5,
    friction: Annotated[float, Parameter(help="Friction coefficient of the soles on the floor.")] = 0.5,
    json: shared.JsonOption = False,
    force: shared.ForceOption = False,
) -> int:
    """Simulate a designed dance in MuJoCo with a free-standing body, and render it as a video next to the plan.

    A fall, a hand or knee on the floor, or pressure outside the planned soles ends with exit code 1.

    Parameters
    ----------
    dance
        The dance.npz written by `biodance dance`, or its folder.
    """
    from biodance.dance.dance import Dance
    from biodance.dance.playback import rehearse
    from biodance.report.dance import playback_document
    from biodance.report.figures.dance import film_path, write_film

    place, one = film_path(out, force=force), Dance.load(dance)
    with counted_progress() as tell:
        tell("playing in MuJoCo", 0, 0)
        found = rehearse(one, hold=hold, friction=friction)
        tell("drawing the film", 0, 0)
        write_film(found, place)
    if json:
        shared.print_json(playback_document(found, place))
    else:
        sys.stdout.write(f"{found.table()}\n{place}\n")
    return shared.NEEDS_A_PERSON if found.broken else shared.DONE


def _sides(plate: str) -> tuple[float, float]:
    """Return the sides of a plate, m, named as SIDE,AHEAD."""
    try:
        side, ahead = (float(one) for one in plate.split(","))
    except ValueError as error:
        raise BiodanceError(
            f"--plate {plate}: expected two lengths in m, from side to side and ahead of the person, for example "
            f"0.40,0.60."
        ) from error
    return side, ahead


def _who(person: shared.PersonFacts, robot: shared.RobotFile) -> "Subject | shared.RobotFile":
    """Return the person or the robot; BiodanceError if it is neither or both."""
    from biodance.records import Subject

    sex, height, mass = person.sex, person.height, person.mass
    if robot.urdf is not None and robot.feet is not None and (sex, height, mass) == (None, None, None):
        return robot
    if sex is not None and height is not None and mass is not None and not robot.given:
        return Subject(mass, height, sex, person.age)
    raise BiodanceError(
        "Say who dances: a person with --sex, --height and --mass, or a robot with --urdf FILE and --feet RIGHT,LEFT."
    )


@contextmanager
def counted_progress() -> Iterator[Callable[[str, int, int], None]]:
    """Yield a function that shows on stderr what is done, how many parts, and of how many (0: unknown)."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task("", total=None)
        yield lambda what, done, of: bars.update(task, description=what, completed=done, total=of or None)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Drawn:
    """What chance and the user put into a simulated session."""

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


@shared.app.command(name="simulate", group=shared.ADVANCED)
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


@shared.app.command(name="effects", group=shared.ADVANCED)
def effects_command(name: str | None = None, *, json: shared.JsonOption = False) -> int:
    """List the causes of disagreement that are looked for: parameters with units, and which can be simulated.

    Parameters
    ----------
    name
        One cause only, e.g. added_mass. The values of one are written --effect NAME:target=WHERE,parameter=value.
    """
    from biodance.effects import causes
    from biodance.report.tables.diagnosis import CAUSE_ROW, causes_shown
    from biodance.report.terminal import print_table

    document = CAUSE_ROW.rows(causes(None if name is None else [name]).values())
    shared.show(document, lambda rows, console: print_table(CAUSE_ROW, causes_shown(rows), console), json=json)
    return shared.DONE


@shared.app.command(name="demo", group=shared.EVERYDAY)
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
        folder = put_session(place, result.session)
    return print_reported(result, folder, found, False)


@contextmanager
def _simulated_anew(folder: Path, *, force: bool) -> Iterator[Path]:
    """Yield where to simulate: ``folder``, or with ``force`` one that takes a simulated session's place."""
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
