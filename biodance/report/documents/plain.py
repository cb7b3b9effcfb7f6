"""Records as plain values: their attributes under the keys of a document, and a document as JSON text."""

import json
import math
from collections.abc import Mapping
from operator import attrgetter
from typing import Any

import numpy as np


def keyed(record: object | None, keys: str) -> dict[str, Any]:
    """Return attributes of a record under the keys of a document, in their order.

    ``"segment kg=mass unit=cause.unit"`` gives ``{"segment": record.segment, "kg": record.mass, "unit":
    record.cause.unit}``; None of no record is under every key.
    """
    pairs = (one.partition("=") for one in keys.split())
    return {key: None if record is None else attrgetter(name or key)(record) for key, _, name in pairs}


def plain_values(value: object) -> Any:
    """Return ``value`` made of dict, list, str, int, float, bool and None only; a number that is not finite becomes
    None.
    """
    if isinstance(value, float) and not isinstance(value, np.generic):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): plain_values(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain_values(value.tolist())
    if isinstance(value, list | tuple):
        return [plain_values(item) for item in value]
    if isinstance(value, np.generic):
        return plain_values(value.item())
    return value if value is None or isinstance(value, str | int | bool) else str(value)


def to_text(document: object) -> str:
    """Return one JSON document as text (indented, keys in their order, newline at the end)."""
    return json.dumps(plain_values(document), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
