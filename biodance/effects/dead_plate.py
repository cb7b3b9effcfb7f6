"""A force plate reads the same whatever happens: a stuck or unplugged channel, an amplifier at its end."""

from dataclasses import replace

import numpy as np

from biodance.effects._base.quality_check import DiscreteEffect, QualityCheck, Recorded, checks_of_defects
from biodance.effects._base.words import About, CauseWords
from biodance.records import LeftOut, Trial

_CHECK = "plates that measure"


class DeadPlate(DiscreteEffect):
    """A plate that does not measure: far from zero, which the reader leaves out, or at one value under a foot."""

    name = "dead_plate"
    separated_by = "A step on the plate, and a recording of it empty."
    advice = "Check the cable, the amplifier and the zero of this plate; until then keep the feet off it."
    about = About(
        what="A force plate reads the same whatever happens: a stuck or unplugged channel, an amplifier at its end.",
        signature=(
            "A constant force through a whole recording: far from zero while the person moves or stands on other "
            "plates, or whatever it is while most of a foot rests on the plate and others measure."
        ),
        look_alikes="The offset of an empty plate (small beside a person), somebody who stands very still.",
        settled_by="A step on the plate.",
    )
    words = CauseWords("{it} measures nothing", "Leave it out, or record again.", "a dead plate")

    @classmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return the plates that readers left out as dead, and those that say nothing of the foot that rests on
        them.
        """
        left = checks_of_defects(recorded.session, cls.name, check=_CHECK, quantity="force")
        silent: dict[str, list[str]] = {}
        for trial in recorded.session.trials:
            for name in _silent(trial, recorded):
                silent.setdefault(name, []).append(trial.name)
        return left + tuple(
            QualityCheck(
                _CHECK,
                False,
                f"{name} reads the same to the last bit while a foot rests on it ({', '.join(trials)}).",
                cls.name,
                name,
                trials=tuple(trials),
            )
            for name, trials in silent.items()
        )

    @classmethod
    def undone(cls, trial: Trial, found: QualityCheck) -> Trial:
        """Return the trial without the plate: a foot on it is a foot beside the plates."""
        if found.mended:
            return trial
        return replace(trial, plates=tuple(one for one in trial.plates if one.name != found.target))


def _silent(trial: Trial, recorded: Recorded) -> list[str]:
    """Return the plates of a trial that read one value while a foot rests on them and another plate measures: where
    none does, no force was recorded, and one that then carries a load under no foot was exchanged with them.
    """
    dead = [one.name for one in trial.plates if np.all(np.ptp(one.wrench.value, axis=0) == 0)]
    contact = recorded.contacts.get(trial.name)
    if contact is None or not dead or len(dead) == len(trial.plates):
        return []
    unread, orphan = (contact.left_out.get(k, False) for k in (LeftOut.SILENT_PLATE, LeftOut.NO_FOOT_ON_PLATE))
    return [] if np.any(unread & orphan) else [name for name in dead if name in contact.silent]


EFFECT = DeadPlate
