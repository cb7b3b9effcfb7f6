"""One visit of one person: point at the folder, get the subject, the trials with their roles, and what had to be
refused or guessed.
"""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from biodance.discovery import Chosen
from biodance.errors import BiodanceError, SessionRefused
from biodance.lab.markers.guess import guess_set, said_of
from biodance.lab.markers.sets import MarkerSet, read_marker_set
from biodance.lab.markers.upright import is_still, movement
from biodance.lab.plates.read import one_place
from biodance.lab.readers import Reader, extensions, read_trial
from biodance.lab.session import recordings
from biodance.lab.session.archive import visit_date
from biodance.lab.session.entries import with_parts_corrected
from biodance.lab.session.file import SessionFile, VisitEntry, read_session_file
from biodance.lab.session.subject import identify_subject
from biodance.records import Role, Session, Trial
from biodance.records.attention import Doubt
from biodance.settings import Settings
from biodance.threads import one_thread


def visit_words(folder: Path, trials: Iterable[str]) -> Mapping[str, str]:
    """Return ``date`` (ISO 8601), ``lab``, ``operator`` and ``condition`` of a session, each "" where nobody says.

    ``[session]`` of session.toml says it; else the Eclipse notes (.enf) of its ``trials``: their descriptions are the
    condition, the day they were made the date.
    """
    try:
        said = read_session_file(folder).visit
    except BiodanceError:
        said = VisitEntry()
    names, eclipse = {name.lower() for name in trials}, recordings.vicon_notes([folder] if folder.is_dir() else [])[0]
    notes = [one for one in eclipse.values() if one.trial.lower() in names]
    described = dict.fromkeys(one.description for one in notes if one.description)
    # CREATIONDATEANDTIME=2020,3,5,11,16,0
    days = (re.match(r"(\d{4}),(\d{1,2}),(\d{1,2})\b", one.fields.get("CREATIONDATEANDTIME", "")) for one in notes)
    made = sorted(f"{day[1]}-{day[2].zfill(2)}-{day[3].zfill(2)}" for day in days if day)
    return {
        "date": visit_date(folder) or (made[0] if made else ""),
        "lab": said.lab or "",
        "operator": said.operator or "",
        "condition": said.condition or ", ".join(described),
    }


@one_thread()
def read_session(
    folder: str | Path,
    *,
    subject_name: str | None = None,
    settings: Settings | Mapping[str, object] | None = None,
    readers: Chosen[Reader] = None,
    markers: str | Path | None = None,
    tell: Callable[[str], None] | None = None,
) -> Session:
    """Read the session in a folder: the subject and every trial that can be read.

    Roles come from session.toml, else from the Eclipse notes (.enf), else from the names (static*, cal* = static;
    squat* = validate; others = fit); without a static by these, the stillest trial is taken. The subject comes from
    session.toml, .mp, .vsk and the files' own parameters, in this order. A file that cannot be read never stops the
    session: it stands in ``Session.refused`` with the reason. What was followed, guessed or left aside stands in
    ``Session.notes``.

    Parameters
    ----------
    folder : str or pathlib.Path
        With the recordings of one visit, and session.toml where there is one; or one C3D file, which is read alone.
    subject_name : str, optional
        Chooses the person in C3D files that hold several.
    settings : Settings or mapping, optional
        A record: these and no others. A mapping, ``{"filter.cutoff": 6}``: as session.toml says, with these changed.
    readers : iterable, optional
        As for `read_trial`.
    markers : str or pathlib.Path, optional
        The marker set that was worn, a name or the path of a file; before what session.toml says of it.
    tell : callable, optional
        Called with the name of each file before it is read.

    Returns
    -------
    Session
        ``session["squat_1"]`` is a trial.

    Raises
    ------
    SessionRefused
        Not a folder, no recording in it, none that can be read, or a session.toml with a mistake.
    UnknownName
        There is no such setting.
    BiodanceError
        A setting is not legal.

    See Also
    --------
    examine : Take it through all stages.

    Examples
    --------
    >>> session = biodance.read_session("visit", settings={"filter.cutoff": 6})
    >>> session.settings
    Settings(filter.cutoff=6.0)
    """
    place, folder = session_place(folder)
    file_says = read_session_file(folder)
    chosen = settings if isinstance(settings, Settings) else file_says.settings.changed(settings or {})
    worn = str(markers) if markers is not None else file_says.marker_set
    marker_set = read_marker_set(worn) if worn else None
    files, notes = recordings.find_recordings(place, readers)
    eclipse, measurements, refused = recordings.vicon_notes({folder, *(file.parent for file in files)})
    trials: list[Trial] = []
    reasons, labels = dict[str, str](), set[str]()
    for file in files:
        operator = eclipse.get(file.stem.lower())
        role, reason = _role(file, folder, file_says, operator)
        if role == "skip":
            notes.append(f"{file.name} was left aside: {reason}.")
            continue
        if tell:
            tell(file.name)
        try:
            trial = read_trial(
                file, role=role, subject=subject_name, readers=readers, markers=marker_set, told=file_says.told
            )
            labels.update(trial.markers.names if trial.markers is not None else ())
            trial = replace(trial, settings=chosen, warnings=(*trial.warnings, *_invalid_strikes(operator)))
            trial = with_parts_corrected(trial, file_says.parts(file.stem))
        except BiodanceError as error:
            refused[file.name] = str(error)
            continue
        trials.append(replace(trial, name=f"{file.parent.name}_{trial.name}") if trial.name in reasons else trial)
        reasons[trials[-1].name] = reason
    if not trials:
        raise SessionRefused(_nothing_left(folder, files, refused, readers))
    recordings.refuse_several_people(folder, trials, file_says.subject)
    notes += [*recordings.decimal_commas(trials), *recordings.forces_apart(trials)]
    trials = _settle_static(recordings.each_once(trials, notes), file_says, reasons, notes)
    trials, strangers = recordings.of_one_person(trials, file_says.subject)
    refused |= strangers
    trials, placed = one_place(trials)
    notes += placed
    if marker_set is None:
        trials, guessed = dress(trials)
        notes += guessed
    called = subject_name or folder.resolve().name
    subject, guesses = identify_subject(file_says.subject, measurements, trials, name=called, devices=file_says.devices)
    read = [f"{path.name} in {path.parent.name} was followed." for path in file_says.read]
    roles = [f"{trial.name} has the role {trial.role}: {reasons[trial.name]}." for trial in trials]
    plates = {plate.name for trial in trials for plate in trial.plates}
    slips = file_says.unused([file.stem for file in files], plates, labels)
    return Session(subject, tuple(trials), folder, refused, (*read, *slips, *roles, *notes, *guesses))


def session_place(folder: str | Path) -> tuple[Path, Path]:
    """Return what is read, a folder or one C3D file, and its folder, with a name also where it is "."; SessionRefused
    if it is missing or something else.
    """
    folder = Path(folder)
    if folder.is_file() and folder.suffix.lower() == ".c3d":
        return folder, session_place(folder.parent)[1]
    if not folder.exists():
        raise SessionRefused(f"{folder}: there is no such folder. Check the path.")
    if not folder.is_dir():
        raise SessionRefused(
            f"{folder}: is a file; a session is a folder with a static trial and trials. Give the folder."
        )
    named = folder.resolve() if folder.name in ("", "..") else folder
    return named, named


def _role(
    file: Path, folder: Path, settings: SessionFile, operator: recordings.EclipseNotes | None
) -> tuple[Role, str]:
    """Return the role of a recording and why it has it."""
    if role := settings.role(file.stem):
        return role, "session.toml says so"
    # TYPE Static, else the words of the description as in a name
    if operator and "static" in operator.type.lower():
        return "static", "the Eclipse notes (.enf) say so"
    if operator and (role := recordings.role_by_name(operator.description)):
        return role, "the Eclipse notes (.enf) say so"
    if role := recordings.role_by_name(file.stem):
        return role, "guessed from its name"
    if file.parent != folder and (role := recordings.role_by_name(file.parent.name)):
        return role, f"guessed from its folder {file.parent.name}"
    return "fit", "a movement: its name says no other role"


def _invalid_strikes(operator: recordings.EclipseNotes | None) -> list[str]:
    """Return a warning for every plate that the operator marked as invalid in Eclipse."""
    why = "as invalid in Eclipse: the foot may not have struck that plate cleanly."
    states = operator.plates.items() if operator else ()
    return [f"The operator marked {plate} {why}" for plate, state in states if state.lower() == "invalid"]


def _settle_static(
    trials: list[Trial], settings: SessionFile, reasons: dict[str, str], notes: list[str]
) -> list[Trial]:
    """Return the trials, one of them static where nobody told which; note a static that moves, or none."""
    for trial in trials:
        if trial.role == "static" and trial.markers is not None and not is_still(trial):
            travels = f"{trial.name} is the static trial, but its markers travel {movement(trial.markers):.2f} m"
            notes.append(Doubt(travels, "Is it the right file? Set its role in session.toml."))
    if any(trial.role == "static" for trial in trials):
        return trials
    # of the still ones that with the most markers; a single frame, which some laboratories keep, counts as still
    asked = (trial for trial in trials if settings.role(trial.source.path.stem) is None)
    still = [(trial, trial.markers) for trial in asked if trial.markers is not None and is_still(trial)]
    quality = [(int(markers.seen.any(axis=0).sum()), -movement(markers)) for _, markers in still]
    guess = still[quality.index(max(quality))][0] if still else None
    if guess is None or guess.markers is None:
        notes.append(
            "There is no static trial: none is called so, and in none do markers stand still. Record one, or name it "
            "in session.toml."
        )
        return trials
    frames = guess.markers.time.size
    why = "it has a single frame" if frames == 1 else f"its markers stay within {1000 * movement(guess.markers):.1f} mm"
    reasons[guess.name] = f"guessed, no trial is called static and {why}; set its role in session.toml if this is wrong"
    return [replace(trial, role="static") if trial is guess else trial for trial in trials]


def _nothing_left(folder: Path, files: Sequence[Path], refused: Mapping[str, str], readers: Chosen[Reader]) -> str:
    """Say why no recording of a folder is left: none there, none that can be read, or all to be skipped."""
    if refused:
        name, reason = next(iter(refused.items()))
        if len(refused) == 1:
            return f"{folder}: its only file, {name}, cannot be read. {reason}"
        return f"{folder}: none of its {len(refused)} files can be read. The first, {name}: {reason}"
    if files:
        names = ", ".join(file.name for file in files[:3]) + (", ..." if len(files) > 3 else "")
        return f"{folder}: every recording ({names}) has the role skip. Give one another role in session.toml."
    inside = [
        part.name for part in sorted(folder.iterdir()) if part.is_dir() and recordings.recordings_below(part, readers)
    ]
    if inside:
        return (
            f"{folder}: holds no recording itself, but these folders do: {', '.join(inside[:8])}. Point at one of them."
        )
    return f"{folder}: holds no recording. Legal are files of the formats {', '.join(extensions(readers))}."


def dress(trials: Sequence[Trial]) -> tuple[list[Trial], list[str]]:
    """Return the trials, all with one marker set where their labels allow it, and what was found in sentences.

    The set is that of the first static trial, else of the trial with most markers; where no known set fits that trial,
    it is guessed from its names and posture. A moving trial that lacks markers of the static one (medial markers, an
    alignment device) is read with the same set; a trial that a known set fits better keeps that.
    """
    worn = [trial for trial in trials if trial.markers is not None]
    if not worn:
        return list(trials), []
    order = sorted(worn, key=lambda trial: (trial.role != "static", -len(trial.markers.names if trial.markers else ())))
    if any(trial.marker_set for trial in order):
        leader = next(trial for trial in order if trial.marker_set)
        found, notes = read_marker_set(leader.marker_set), []
    else:
        guesses = [(trial, guess_set(trial.markers)) for trial in order if trial.markers is not None]
        leader, guess = next(((trial, one) for trial, one in guesses if one.name), guesses[0])
        notes = [said_of(guess, leader.name)]
        if not guess.name:
            why = f"No marker set could be guessed: {guess.doubts[0]}"
            doubted = (
                replace(trial, warnings=(*trial.warnings, why)) if trial.markers is not None else trial
                for trial in trials
            )
            return list(doubted), notes
        found = read_marker_set(guess.name)
    return [_with(trial, found) for trial in trials], notes


def _with(trial: Trial, found: MarkerSet) -> Trial:
    """Return a trial with the session's set, unless its own fits more of its labels."""
    if trial.markers is None or trial.marker_set == found.name:
        return trial
    matched = found.match(trial.markers.names)
    own = len(read_marker_set(trial.marker_set).match(trial.markers.names)) if trial.marker_set else 0
    # Six labels: three markers on each of two segments.
    if len(matched) < max(6, own):
        return trial
    return replace(trial, marker_set=found.name)
