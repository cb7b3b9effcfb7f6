"""The search for a load as one sentence, the same on every page and in the terminal."""

from biodance.display import spaced
from biodance.identification.added_mass import LoadSearch

_ADVICE = "Compare with an unloaded session of the same person (--reference)."


def say_load(search: LoadSearch) -> str:
    """Return what the search found in words: how heavy, where, how sure, or why that cannot be told."""
    if search.doubts:
        return f"Whether the subject carries a load cannot be told: {' '.join(search.doubts)}"
    return {"found": _found, "none": _none, "cannot tell": _unclear}[search.status](search)


def _found(search: LoadSearch) -> str:
    best = search.best
    x, y, z = (f"{1000 * value:.0f}" for value in best.place)
    several = len(search.segments) > 1
    if_there = f" if it is on the {_words(best.segment)}" if several else ""
    other = f" (there the {_words(search.lies_on)} is nearer)" if search.lies_on not in ("", best.segment) else ""
    apart = " The segments are known together, not apart: what the plates measured fits a load on each." * several
    return (
        f"Beyond {search.reference} the subject carries {size_and_segments(search)}. Its centre{if_there} is {x}, "
        f"{y}, {z} mm from that segment's proximal joint centre, along its x (forward), y (up) and z "
        f"(right){other}.{apart}"
    )


def size_and_segments(search: LoadSearch) -> str:
    """Return how heavy the load is, which segments may carry it and how sure that is, the same words wherever it is
    told.
    """
    low, high = search.best.interval
    none = f"{search.p_no_load:.3f}" if search.p_no_load >= 0.001 else "below 0.001"
    return (
        f"{search.best.mass:.2f} kg on the {_segments(search)} (95 % interval {low:.2f} to {high:.2f} kg; probability "
        f"of no load {none})"
    )


def _segments(search: LoadSearch) -> str:
    """Return the segments that may carry the load, most probable first; beyond three the others are counted."""
    first, *others = map(_words, search.segments)
    if not others:
        return first
    if len(others) > 2:
        others = [*others[:2], f"one of {len(others) - 2} more"]
    share = search.best.probability / max(1.0 - search.p_no_load, search.best.probability)
    return " or ".join([", ".join([f"{first} ({100 * share:.0f} % probable)", *others[:-1]]), others[-1]])


def _none(search: LoadSearch) -> str:
    sizes = sorted((one.smallest, one.segment) for one in search.suspects)
    (low, easy), (high, hard) = sizes[0], sizes[-1]
    return (
        f"No load is found beyond {search.reference} (probability of no load {search.p_no_load:.2f}). The smallest "
        f"that this session would find in half of the cases: {low:.1f} kg ({_words(easy)}) to {high:.1f} kg "
        f"({_words(hard)})."
    )


def _unclear(search: LoadSearch) -> str:
    advice = "" if search.reference != "the table" else f" {_ADVICE}"
    return (
        f"Whether the subject carries a load beyond {search.reference} cannot be told. If so, it would be "
        f"{size_and_segments(search)}; this session finds {search.best.smallest:.1f} kg there in half of the "
        f"cases.{advice}"
    )


def _words(segment: str) -> str:
    return spaced(segment)
