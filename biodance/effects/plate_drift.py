"""The zero of a force-plate channel wanders during the session."""

from biodance.effects._base.case import Case
from biodance.effects._base.effect import ChannelEffect, Parameter
from biodance.effects._base.words import ACCEPT, About, CauseWords, CheckKind
from biodance.effects.plate_offset import PlateOffset
from biodance.records import Array


class PlateDrift(ChannelEffect):
    """A ``drift`` (N or N·m over the whole session) about the plate's centre in channel ``target``, zero in the
    middle of the session.
    """

    name = "plate_drift"
    parameters = (
        Parameter(
            "drift",
            "N or N·m",
            3.0,
            "a few newtons per session (laboratory experience; acceptance limit 1 N of one lab)",
            least=PlateOffset.parameters[0].least,
        ),
    )
    grows = PlateOffset
    separated_by = "The first trial repeated at the end, and the empty plate before and after."
    advice = "Let the plate warm up, zero it before each trial."
    about = About(
        what="The zero of a force-plate channel wanders during the session.",
        signature="An offset that grows from trial to trial, minus half at the start, plus half at the end.",
        look_alikes="A posture that changes with fatigue; a drifting clock.",
        settled_by="Repeating the first trial at the end and by unloaded recordings before and after.",
    )
    words = CauseWords(
        "{it} drifts by {size}{between} over the session", f"Zero the plate before each trial{ACCEPT}", "a drift"
    )
    explains = (CheckKind.FORCES,)

    def in_channel(self, case: Case) -> Array:
        """Return session time minus one half; zero in a trial that saw the plate empty: there its reading was taken
        off.
        """
        return (case.session_time - 0.5) * (not self.plate_of(case).tared)


EFFECT = PlateDrift
