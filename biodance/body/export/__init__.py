"""FAMILY: one model format per file, found automatically; other packages join by the entry points ``biodance.exports``.

A member is a module or object of the form `ModelFormat`; it writes the joints of the body, its inertial parameters and, where the format
knows them, markers, limits and boxes. All lengths in m, angles in rad, masses in kg.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

import numpy as np

from biodance.body.body import Body
from biodance.body.inertia import pseudo_inertia
from biodance.discovery import Chosen, Family, missing_of
from biodance.errors import BiodanceError, FileRefused

ROUNDING = 1e-9
"""Share of a pseudo-inertia's largest eigenvalue by which its smallest may be negative from rounding alone."""


class ModelFormat(Protocol):
    """One format of models: a module, a class or an object."""

    FORMAT: str
    """Its name on the command line."""
    SUFFIX: str
    """The usual suffix of its files, with the dot."""

    def text(self, body: Body, source: str) -> str:
        """Return the whole file; ``source`` is one line that says where the parameters come from."""


FAMILY: Family[ModelFormat] = Family("model format", "biodance.exports", __name__, "", missing_of(ModelFormat), lambda one: one.FORMAT)


def formats(chosen: Chosen[ModelFormat] = None) -> Mapping[str, ModelFormat]:
    """Return the formats by name; ``chosen`` names choose from the family, objects join it."""
    return FAMILY.choose(chosen)


def refuse_impossible(body: Body) -> None:
    """Raise BiodanceError if a segment's parameters belong to no mass distribution (pseudo-inertia not positive, no mass)."""
    for name in body.segments:
        phi = body.sip.of(name)
        if not np.isfinite(phi).all():
            raise BiodanceError(f"Segment {name}: an inertial parameter is not a number, so no model can be written. Identify again.")
        if phi[0] <= 0:
            raise BiodanceError(f"Segment {name}: a mass of {phi[0]:g} kg cannot exist, so no model is written. Masses must be positive.")
        value = np.linalg.eigvalsh(pseudo_inertia(phi)[0])
        if value[0] < -ROUNDING * value[-1]:
            raise BiodanceError(
                f"Segment {name}: no body has this mass, centre and inertia (pseudo-inertia eigenvalue {value[0]:.3g}, must be >= 0), so "
                "no model is written. Use physically consistent parameters."
            )


def write_model(body: Body, path: str | Path, *, format: str | ModelFormat, source: str = "") -> Path:
    """Write ``body`` as a model file and return the path; ``format`` is the name of one, or an object that writes it.

    Raises
    ------
    UnknownName
        There is no such format.
    BiodanceError
        The inertia of a segment cannot exist, or the format cannot hold the joints of this body.
    FileRefused
        The file exists (nothing is overwritten), or cannot be written.
    """
    path = Path(path)
    (kind,) = (FAMILY.choose([format]) if isinstance(format, str) else FAMILY.judged([format])).values()
    refuse_impossible(body)
    content = kind.text(body, source)
    try:
        with open(path, "x", encoding="utf-8", newline="\n") as stream:
            stream.write(content)
    except FileExistsError:
        raise FileRefused(f"{path}: exists already and is not overwritten. Choose another name or remove it.") from None
    except OSError as error:
        raise FileRefused(f"{path}: cannot be written ({error.strerror or error}). Choose a place where you may write.") from error
    return path
