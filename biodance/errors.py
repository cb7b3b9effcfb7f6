"""Errors of biodance: every message says what, where, the value, what would be legal, and what to do.

Only wrong input raises. A computation that fails on correct input (a solver that stops, a parameter that cannot be known)
is a status in its result, not an exception.
"""


class BiodanceError(ValueError):
    """Root of all errors that biodance raises on purpose; its text is one plain sentence for the analyst."""


class FileRefused(BiodanceError):
    """A file that cannot be read, or that cannot be trusted: names the file, the fault and the remedy."""


class TrialRefused(BiodanceError):
    """A trial that was read but cannot carry the step asked of it (no markers, no plate, no loaded frame ...)."""


class SessionRefused(BiodanceError):
    """A session folder from which no step can be done (empty, no readable trial, contradictory session.toml)."""


class NotSolved(BiodanceError):
    """Parameters were asked of an estimate that failed and has none: its cause and cure. Look at ``status`` before."""


class UnknownName(BiodanceError):
    """A name that is not in the library or record it was looked up in; lists the legal names."""

    @classmethod
    def of(cls, kind: str, name: str, legal: list[str] | tuple[str, ...]) -> "UnknownName":
        """Build the error for ``name``, which is no ``kind``; ``legal`` are all names that would have been right."""
        from difflib import get_close_matches

        close = get_close_matches(name, legal, n=1)
        hint = f" Did you mean {close[0]!r}?" if close else ""
        article = "an" if kind[0] in "aeio" else "a"
        return cls(f"{name!r} is not {article} {kind}.{hint} Legal: {', '.join(sorted(legal)) or 'none'}.")


class MissingLibrary(BiodanceError):
    """A third-party library that this step needs does not load on this machine; says how to mend it."""
