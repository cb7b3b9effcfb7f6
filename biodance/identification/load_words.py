"""The search for a load as one sentence, the same on every page and in the terminal."""

from biodance.identification.added_mass import LoadSearch

_ADVICE = "Compare with an unloaded session of the same person (--reference)."


def say_load(search: LoadSearch) -> str:
    """Return what the search found in words: how heavy, where, how sure, or why that cannot be told."""
    if search.doubts:
        return f"Whether the subject carries a load cannot be told: {' '.join(search.doubts)}"
    return {"found": _found, "none": _none, "cannot tell": _unclear}[search.status](search)


def _found(search: LoadSearch) -> str:
    x, y, z = (f"{1000 * value:.0f}" for value in search.best.place)
    also = (
        f" It may also sit on: {', '.join(map(_words, search.set[1:]))}. They are known together, not apart: what "
        f"the plates measured fits a load on each."
        if search.set[1:]
        else ""
    )
    return (
        f"Beyond {search.reference} the subject carries {_size(search)}; its centre is {x}, {y}, {z} mm "
        f"from the segment's proximal joint centre, along its x (forward), y (up) and z (right).{also}"
    )


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
        f"{_size(search)}; this session finds {search.best.smallest:.1f} kg there in half of the cases.{advice}"
    )


def _size(search: LoadSearch) -> str:
    best, none = search.best, search.p_no_load
    low, high = best.interval
    return (
        f"{best.mass:.2f} kg on the {_words(best.segment)} (95 % interval {low:.2f} to {high:.2f} kg; probability of "
        f"no load {f'{none:.3f}' if none >= 0.001 else 'below 0.001'})"
    )


def _words(segment: str) -> str:
    return segment.replace("_", " ")
