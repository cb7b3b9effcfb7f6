"""Write XML model files: numbers without loss, indented, with a comment on top."""

import re
from collections.abc import Iterable
from xml.etree.ElementTree import Comment, Element, SubElement, indent, tostring

import numpy as np

from biodance.records import Array


def row(values: Iterable[float] | Array) -> str:
    """Return numbers separated by blanks, each with all its digits."""
    return " ".join(repr(float(v) + 0.0) for v in np.ravel(np.asarray(values, dtype=float)))


def plain(name: str) -> str:
    """Return a name without blanks and signs that OpenSim and biorbd refuse in names."""
    return re.sub(r"[^\w.-]", "_", name) or "model"


def add(parent: Element, tag: str, text: str = "", **attributes: str) -> Element:
    """Append an element with text and attributes and return it."""
    element = SubElement(parent, tag, attributes)
    element.text = text or None
    return element


def document(root: Element, source: str) -> str:
    """Return the file's text; ``source`` becomes a comment under the root element."""
    if source:
        root.insert(0, Comment(f" {source.replace('--', '- -')} "))
    indent(root, space="  ")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"


def six(inertia: Array) -> str:
    """Return xx yy zz xy xz yz of a tensor (3, 3): the order of MJCF's fullinertia and of .osim."""
    return row(inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])
