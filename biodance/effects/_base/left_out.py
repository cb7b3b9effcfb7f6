"""What a reader saw and left out of a recording (`records.Defect`), as checks of a cause."""

from biodance.effects._base.quality_check import QualityCheck
from biodance.records import Defect, Session


def checks_of_defects(session: Session, effect: str, *, check: str, quantity: str) -> tuple[QualityCheck, ...]:
    """Return a failed ``check`` for every target at which readers left something out because of ``effect``: what was
    seen in its first trial, and in which trials it is. None where nothing was left out.
    """
    first: dict[str, Defect] = {}
    trials: dict[str, list[str]] = {}
    for trial in session.trials:
        for one in trial.defects:
            if one.effect == effect:
                first.setdefault(one.target, one)
                trials.setdefault(one.target, []).append(trial.name)
    found = []
    for target, one in first.items():
        text = f"{one.text} ({', '.join(trials[target])})"
        found.append(QualityCheck(check, False, text, effect, target, one.size, quantity, one.unit, mended=True))
    return tuple(found)
