"""Foot strikes and offs that session.toml says by hand."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from itertools import pairwise
from math import isfinite

from biodance.errors import SessionRefused, TrialRefused
from biodance.records import SIDES, FootEvent, Trial

_KINDS = {"strike": True, "off": False}
_KEYS = ("side", "kind", "time")
_EXAMPLE = '{side = "left", kind = "strike", time = 1.23}'


def legal_events(given: Sequence[Mapping[str, float | str]] | None) -> tuple[FootEvent, ...]:
    """Return the events that a list of ``{side, kind, time}`` says, in the order of time; ``kind`` strike or off.

    Raises
    ------
    SessionRefused
        A key is missing or unknown, a value is not legal, or a foot strikes twice without an off between (or leaves
        twice without a strike).
    """
    found = sorted((_event(one) for one in given or ()), key=lambda one: one.time)
    for side in SIDES:
        for one, after in pairwise(one for one in found if one.side == side):
            if one.down is after.down or one.time == after.time:
                raise SessionRefused(
                    f"events has the {_said(one)} and then the {_said(after)} with no {_kind(not one.down)} between "
                    f"them. Add that one, or take one of the two out."
                )
    return tuple(found)


def _event(given: Mapping[str, float | str]) -> FootEvent:
    for key in given:
        if key not in _KEYS:
            close = get_close_matches(key, _KEYS, n=1)
            hint = f" Did you mean {close[0]!r}?" if close else ""
            raise SessionRefused(f"events has the unknown key {key!r}.{hint} Legal: {', '.join(_KEYS)}.")
    side, kind, time = (given.get(key) for key in _KEYS)
    if side not in SIDES or kind not in _KINDS or not isinstance(time, int | float) or not isfinite(time):
        raise SessionRefused(
            f"events has {dict(given)!r}, which is not legal. Write a side (left, right), a kind (strike, off) and the "
            f"time in s: {_EXAMPLE}."
        )
    return FootEvent(float(time), str(side), _KINDS[str(kind)], "hand")


def with_events(trial: Trial, events: tuple[FootEvent, ...]) -> Trial:
    """Return a trial with the ``events`` that session.toml says; the history names their sides.

    Raises
    ------
    TrialRefused
        One is not within the trial.
    """
    clocks = [trial.markers.time] if trial.markers is not None else []
    clocks += [plate.wrench.time for plate in trial.plates]
    begin, end = min(time[0] for time in clocks), max(time[-1] for time in clocks)
    for one in events:
        if not begin <= one.time <= end:
            raise TrialRefused(
                f"Trial {trial.name}: session.toml has the {_said(one)} in [trials.{trial.name}] events, which is not "
                f"within the recording, {begin:g} to {end:g} s. Correct the time, or take the event out."
            )
    sides = " and ".join(side for side in SIDES if any(one.side == side for one in events))
    said = f"The {len(events)} strikes and offs of the {sides} foot were set by hand, as session.toml says."
    return replace(trial, events=events, history=(*trial.history, said))


def _said(event: FootEvent) -> str:
    return f"{event.side} {_kind(event.down)} at {event.time:g} s"


def _kind(down: bool) -> str:
    return "strike" if down else "off"
