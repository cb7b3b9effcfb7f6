"""A paragraph on the methods with its references: each clause says a value of results.json, or goes without it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from biodance.display import spaced
from biodance.records import SIDES
from biodance.report.wording import format_number

METHODS = "methods.md"
REFERENCES: Mapping[str, str] = {
    "Bonnet": "Bonnet V. et al. (2016). IEEE Transactions on Robotics. doi:10.1109/TRO.2016.2583062",
    "Baker": "Baker R. (2001). Gait & Posture 13:1. doi:10.1016/S0966-6362(00)00083-7",
    "Carpentier": "Carpentier J. et al. (2019). IEEE/SICE SII (Pinocchio). doi:10.1109/SII.2019.8700380",
    "Davis": "Davis R. et al. (1991). Human Movement Science 10:575. doi:10.1016/0167-9457(91)90046-Z",
    "de Leva": "de Leva P. (1996). Journal of Biomechanics 29:1223. doi:10.1016/0021-9290(95)00178-6",
    "Harrington": "Harrington M. et al. (2007). Journal of Biomechanics 40:595. doi:10.1016/j.jbiomech.2006.02.003",
    "Robertson": "Robertson D., Dowling J. (2003). J. Electromyogr. Kinesiol. 13. doi:10.1016/S1050-6411(03)00080-4",
    "Wensing": "Wensing P. et al. (2018). IEEE Robotics and Automation Letters 3:60. doi:10.1109/LRA.2017.2729659",
    "Wu": "Wu G. et al. (2002). Journal of Biomechanics 35:543. doi:10.1016/S0021-9290(01)00222-6",
    "Zeni": "Zeni J. et al. (2008). Gait & Posture 27:710. doi:10.1016/j.gaitpost.2007.07.007",
}
"""Short name -> reference, as far as a clause names it."""


@dataclass(frozen=True)
class MethodClause:
    """One clause: ``places`` of results.json whose values it says (``"subject/mass_kg subject/height_m"``); ``say`` a
    format of them, or a function that makes the sentence ("" = there is nothing to say); ``cites`` short names of
    `REFERENCES` by a word that must be in the sentence ("": always).
    """

    places: str
    say: str | Callable[..., str]
    cites: Mapping[str, str] = field(default_factory=dict)

    @property
    def keys(self) -> list[list[str]]:
        """The paths of its values."""
        return [place.split("/") for place in self.places.split()]


def methods_text(document: Mapping[str, Any]) -> str:
    """Return the paragraph as Markdown for the content of a results.json (of report or of identify)."""
    said, cited = [], []
    for clause in CLAUSES:
        # a clause of which any value is not known is left out, with what it cites
        values = [_value(document, path) for path in clause.keys]
        if any(value is None for value in values):
            continue
        sentence = clause.say.format(*values) if isinstance(clause.say, str) else clause.say(*values)
        if sentence:
            said.append(sentence)
            cited += [name for name, word in clause.cites.items() if word in sentence]
    references = "\n".join(f"- {REFERENCES[name]}" for name in sorted(dict.fromkeys(cited)))
    text = f"# Methods\n\n{' '.join(said)}\n"
    return text + (f"\n## References\n\n{references}\n" if references else "")


def _value(document: Mapping[str, Any], path: Sequence[str]) -> Any:
    """Return the value at a path, or None; identification stands at the top of its own results.json."""
    whole = document.get("identification") is None and path[0] == "identification"
    found: Any = document
    for key in path[1:] if whole else path:
        if not isinstance(found, Mapping) or key not in found:
            return None
        found = found[key]
    return found


def _count(some: Any, one: str, many: str | None = None) -> str:
    number = some if isinstance(some, int) else len(some)
    return f"{number} {one if number == 1 else many or one + 's'}"


def _trials(trials: list[dict[str, Any]]) -> str:
    used = [one for one in trials if isinstance(one, dict) and one["status"] != "refused"]
    rates = sorted({f"{one['rate_hz']:g}" for one in used if one["rate_hz"]})
    plates = max((len(one["plates"]) for one in used), default=0)
    told = f"{_count(used, 'trial')} with markers at {' and '.join(rates)} Hz" if rates else _count(used, "trial")
    return f"{told} and {_count(plates, 'force plate')} entered the analysis." if used else ""


def _filter(kind: str, order: float, trials: list[dict[str, Any]]) -> str:
    if not trials:
        return ""
    used = ([one[key] for one in trials] for key in ("markers_hz", "forces_hz"))
    ends = ((min(cutoffs), max(cutoffs)) for cutoffs in used)
    markers, forces = (f"{low:g} Hz" if low == high else f"{low:g} to {high:g} Hz" for low, high in ends)
    both = "" if forces == markers else f" (forces: {forces})"
    own = any(one["chosen_by"] == "trial" for one in trials)
    how = ", in each trial where the filtered markers lie nearest to the path of rigid segments" if own else ""
    words = spaced(kind).replace("butterworth", "Butterworth")
    return (
        f"Joint coordinates and forces were low-pass filtered forwards and backwards ({words}, order {order:g} in each "
        f"direction, {markers}{both}{how})."
    )


def _segments(segments: list[dict[str, Any]], trials: list[str], rank: int, count: int) -> str:
    if not segments:
        return ""
    return (
        f"The inertial parameters of {_count(segments, 'segment')} were identified from the ground reaction wrench of "
        f"{', '.join(trials)} as a Bayesian linear regression with the table as prior, physically consistent by linear "
        f"matrix inequalities (after Bonnet et al., 2016; Wensing et al., 2018); the data reached {rank} of {count} "
        f"base parameters."
    )


def _validated(trials: list[dict[str, Any]]) -> str:
    if not trials:
        return ""
    before, after = (sum(t[kind]["rms"][2] for t in trials) / len(trials) for kind in ("table", "identified"))
    return (
        f"On {_count(trials, 'trial')} not used for the identification the RMS difference of the vertical force was "
        f"{format_number(before, 1)} N with the table and {format_number(after, 1)} N with the identified parameters."
    )


def _movement(trials: list[dict[str, Any]]) -> str:
    kinds = [cycle["kind"] for one in trials for cycle in one["cycles"]]
    words = {"gait": "gait cycle", "squat": "squat", "sit_to_stand": "rise from a chair", "jump": "jump"}
    found = [
        _count(kinds.count(kind), word, "rises from a chair" if kind == "sit_to_stand" else None)
        for kind, word in words.items()
        if kind in kinds
    ]
    if not found:
        return ""
    steps = (
        " Foot events were taken from the force plates (20 N) where a foot stood on one alone, else from the movement "
        f"of the feet relative to the pelvis (after Zeni et al., 2008).{_by_hand(trials)}"
    )
    pelvis = "; the pelvis in the lab follows Baker (2001)" if "gait" in kinds else ""
    return (
        f"Joint angles follow the ISB recommendations (Wu et al., 2002){pelvis}. Curves were normalised to 101 points "
        f"over {', '.join(found)}.{steps if 'gait' in kinds else ''}"
    )


def _by_hand(trials: list[dict[str, Any]]) -> str:
    feet = [
        f"the {side} foot in {one['trial']}"
        for one in trials
        for side in SIDES
        if any(event["side"] == side and event["source"] == "hand" for event in one.get("events", ()))
    ]
    return f" Those of {', of '.join(feet)} were set by hand." if feet else ""


_MOVED = {
    True: "Joint centres were then corrected by the movement where it showed them.",
    False: "Joints were not moved.",
}
CLAUSES: tuple[MethodClause, ...] = (
    MethodClause(
        "provenance/versions/biodance provenance/commit",
        "Recordings were processed with biodance {} (commit {:.12}).",
    ),
    MethodClause("trials", _trials),
    MethodClause(
        "subject/mass_kg subject/height_m",
        "The subject's mass was {:.1f} kg and the stature {:.2f} m.",
    ),
    MethodClause(
        "mass_check/mass_on_plates_kg mass_check/difference_percent",
        "In quiet standing the plates carried {:.1f} kg, {:+.1f} % of the declared mass.",
    ),
    MethodClause(
        "provenance/settings/table provenance/settings/hip",
        lambda table, hip: (
            f"A model of rigid segments was scaled on the static trial; segment masses and inertias were taken from "
            f"the table {table}, hip joint centres from the regression of {hip.title()}."
        ),
        {"de Leva": "de_leva", "Harrington": "Harrington", "Davis": "Davis"},
    ),
    MethodClause("provenance/settings/joints", lambda joints: _MOVED[joints == "functional"]),
    MethodClause(
        "provenance/settings/filter.kind provenance/settings/filter.order filter/trials",
        _filter,
        {"Robertson": "critically damped"},
    ),
    MethodClause(
        "provenance/versions/pin",
        "Rigid-body dynamics were computed with Pinocchio {} (Carpentier et al., 2019).",
        {"Carpentier": ""},
    ),
    MethodClause(
        "identification/segments identification/trials identification/base_parameters/rank "
        "identification/base_parameters/count",
        _segments,
        {"Bonnet": "", "Wensing": ""},
    ),
    MethodClause("identification/validation", _validated),
    MethodClause("movement/trials", _movement, {"Wu": "", "Zeni": "Zeni", "Baker": "Baker"}),
    MethodClause(
        "movement/parameters movement/mass_kg",
        "Joint moments (of the muscles) and powers were computed by inverse dynamics with the {} parameters and "
        "divided by {:.1f} kg.",
    ),
    MethodClause("diagnosis/verdict", "The automatic diagnosis of the recording ended with the verdict “{}”."),
)
"""In the order in which they are said."""
