"""Errors of biodance: every message says what, where, the value, what would be legal, and what to do.

Only wrong input raises. A computation that fails on correct input (a solver that stops, a parameter that cannot be
known) is a status in its result, not an exception.
"""

import re
from collections.abc import Collection, Sequence


class BiodanceError(ValueError):
    """Root of all errors that biodance raises on purpose; its text is one plain sentence for the analyst.

    Examples
    --------
    >>> try:
    ...     biodance.read_session("nowhere")
    ... except biodance.BiodanceError as error:
    ...     print(error)
    nowhere: there is no such folder. Check the path.
    """


class FileRefused(BiodanceError):
    """A file that cannot be read, or that cannot be trusted: names the file, the fault and the remedy.

    Examples
    --------
    >>> biodance.read_c3d("visit/session.toml")
    Traceback (most recent call last):
        ...
    biodance.errors.FileRefused: visit/session.toml: ...
    """


class TrialRefused(BiodanceError):
    """A trial that was read but cannot carry the step asked of it (no markers, no plate, no loaded frame ...).

    Examples
    --------
    >>> from dataclasses import replace
    >>> replace(session["squat_1"], plates=()).wrench
    Traceback (most recent call last):
        ...
    biodance.errors.TrialRefused: Trial squat_1: no force plate was recorded, so there is no wrench. Record with the
    plates on.
    """


class SessionRefused(BiodanceError):
    """A session folder from which no step can be done (empty, no readable trial, contradictory session.toml).

    Examples
    --------
    >>> biodance.read_session("nowhere")
    Traceback (most recent call last):
        ...
    biodance.errors.SessionRefused: nowhere: there is no such folder. Check the path.
    """


class NotSolved(BiodanceError):
    """Parameters were asked of an estimate that failed and has none: its cause and cure. Look at ``status`` before."""


def did_you_mean(name: str, legal: Sequence[str], *, cutoff: float = 0.6) -> str:
    """Return " Did you mean 'X'?" with the ``legal`` name that is nearest; "" where none is as near as ``cutoff``."""
    from difflib import get_close_matches

    close = get_close_matches(name, legal, n=1, cutoff=cutoff)
    return f" Did you mean {close[0]!r}?" if close else ""


class UnknownName(BiodanceError):
    """A name that is not in the library or record it was looked up in; lists the legal names.

    Examples
    --------
    >>> session["squat"]
    Traceback (most recent call last):
        ...
    biodance.errors.UnknownName: 'squat' is not a trial of session visit. Did you mean 'squat_1'? Legal: dance_1,
    squat_1, static.
    """

    @classmethod
    def of(cls, kind: str, name: str, legal: list[str] | tuple[str, ...]) -> "UnknownName":
        """Build the error for a name that does not exist.

        Parameters
        ----------
        kind : str
            What it was taken for.
        name : str
            As it was given.
        legal : list or tuple of str
            All names that would have been right.

        Returns
        -------
        UnknownName
            To be raised.

        Examples
        --------
        >>> print(biodance.UnknownName.of("segment", "thihg", ("thigh", "shank")))
        'thihg' is not a segment. Did you mean 'thigh'? Legal: shank, thigh.
        """
        hint = did_you_mean(name, legal)
        article = "an" if kind[0] in "aeio" else "a"
        return cls(f"{name!r} is not {article} {kind}.{hint} Legal: {', '.join(sorted(legal)) or 'none'}.")


def refuse_unknown(kind: str, name: str, legal: Collection[str]) -> None:
    """Raise UnknownName where a ``name`` of some ``kind`` is none of the ``legal`` ones."""
    if name not in legal:
        raise UnknownName.of(kind, name, tuple(legal))


def known_index(kind: str, name: str, legal: list[str] | tuple[str, ...]) -> int:
    """Return where a ``name`` of some ``kind`` stands among the ``legal`` ones; UnknownName where it is none."""
    refuse_unknown(kind, name, legal)
    return legal.index(name)


class MissingLibrary(BiodanceError):
    """A third-party library that this step needs does not load on this machine; says how to mend it.

    Examples
    --------
    >>> issubclass(biodance.MissingLibrary, biodance.BiodanceError)
    True
    """


_CODES = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
"""Control characters but tab and line end, and those that turn the direction of writing."""


def without_codes(text: str) -> str:
    """Return a text that no terminal obeys: names in files may hold control characters, which become their codes."""
    return _CODES.sub(lambda one: one[0].encode("unicode_escape").decode("ascii"), text)
