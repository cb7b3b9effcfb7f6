"""Tidy CSV: one number a row, with unit, standard deviation, frame and source; for spreadsheets, R and pandas.

The ten standard parameters of every segment (mass, first_moment_*, inertia_* about the joint) are the record and read
back exactly; the centre of mass (com_*) and the inertia about it (central_inertia_*) are derived, with standard
deviations to first order.
"""

import csv
import io

import numpy as np

from biodance.body.body import Body
from biodance.body.parts import rigid_inertia
from biodance.lab.plain_text import for_spreadsheet
from biodance.records import Array

FORMAT = "csv"
SUFFIX = ".csv"
_TENSOR = ("xx", "xy", "yy", "xz", "yz", "zz")
STANDARD = ("mass", *(f"first_moment_{a}" for a in "xyz"), *(f"inertia_{t}" for t in _TENSOR))
_DERIVED = (*(f"com_{a}" for a in "xyz"), *(f"central_inertia_{t}" for t in _TENSOR))
_UNITS = ("kg", *["kg·m"] * 3, *["kg·m²"] * 6, *["m"] * 3, *["kg·m²"] * 6)
"""Of the standard, then of the derived quantities."""


def text(body: Body, source: str) -> str:
    """Return the table of ``body.sip``."""
    stream = io.StringIO()
    write = csv.writer(stream, lineterminator="\n")
    write.writerow(("segment", "quantity", "value", "unit", "sd", "frame", "source"))
    sd = np.sqrt(np.diag(body.sip.covariance)).reshape(-1, 10)
    for i, name in enumerate(body.segments):
        phi, block = body.sip.of(name), slice(10 * i, 10 * i + 10)
        step = 1e-6 * np.maximum(np.abs(phi), 1e-6)
        # First order: diagonal of D C D' with the slopes D by central differences.
        steps = zip(np.diag(step), step, strict=True)
        slope = np.stack([(_derived(phi + h) - _derived(phi - h)) / (2 * size) for h, size in steps], axis=1)
        spread = np.sqrt(np.maximum(np.diag(slope @ body.sip.covariance[block, block] @ slope.T), 0.0))
        numbers = (*phi, *_derived(phi)), (*sd[i], *spread)
        for quantity, unit, value, deviation in zip((*STANDARD, *_DERIVED), _UNITS, *numbers, strict=True):
            about = "centre of mass" if quantity.startswith("central") else "proximal joint centre"
            frame = f"segment axes (x anterior, y up, z right), about the {about}" if quantity != "mass" else ""
            row = [name, quantity, repr(float(value)), unit, repr(float(deviation)), frame, source]
            write.writerow([for_spreadsheet(row[0]), *row[1:]])
    return stream.getvalue()


def _derived(phi: Array) -> Array:
    lump = rigid_inertia(phi)
    return np.concatenate([lump.com, lump.inertia[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]])
