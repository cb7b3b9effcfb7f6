"""One group of settings: fields with unit, meaning and legal range, checked at birth."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from math import isfinite
from typing import Any, ClassVar, NamedTuple, TypeAlias

from biodance.errors import BiodanceError

Value: TypeAlias = str | int | float
GENERAL = "general"


def number_field(default: float, low: float, high: float, unit: str, meaning: str, *, word: str = "") -> Any:
    """Return the field of a number from ``low`` to ``high``; where there is a ``word``, it is the default and legal,
    too.
    """
    return field(
        default=word or default, metadata={"legal": (low, high), "unit": unit, "meaning": meaning, "word": word}
    )


def word_field(default: str, legal: tuple[str, ...], meaning: str) -> Any:
    """Return the field of a word; an empty ``legal`` leaves the choice to whom it concerns."""
    return field(default=default, metadata={"legal": legal, "unit": "", "meaning": meaning, "word": ""})


class Setting(NamedTuple):
    """One setting: its dotted ``key``, ``value``, ``unit`` ("" without one), ``meaning``, and the ``legal`` values
    in words.
    """

    key: str
    value: Value
    unit: str
    meaning: str
    legal: str


@dataclass(frozen=True)
class Group:
    """Settings that belong together; every value is checked at birth, a whole number where a float is meant becomes
    one.
    """

    name: ClassVar[str]

    def __post_init__(self) -> None:
        for one in fields(self):
            if "legal" in one.metadata:
                object.__setattr__(
                    self, one.name, _legal_value(_key(self.name, one.name), getattr(self, one.name), one)
                )

    def rows(self) -> tuple[Setting, ...]:
        """Return the group's own settings in order.

        Returns
        -------
        tuple of Setting
            Named tuples ``(key, value, unit, meaning, legal)``.

        Examples
        --------
        >>> biodance.Settings().filter.rows()[2].unit
        'Hz'
        """
        told = [(one.name, one.metadata) for one in fields(self) if "legal" in one.metadata]
        return tuple(
            Setting(_key(self.name, name), getattr(self, name), a["unit"], a["meaning"], _legal_words(a))
            for name, a in told
        )


def _key(group: str, name: str) -> str:
    return name if group == GENERAL else f"{group}.{name}"


def _legal_words(about: Mapping[str, Any]) -> str:
    legal, unit, word = about["legal"], about["unit"], about["word"]
    if not legal:
        return "a name, or the path of a file"
    if isinstance(legal[0], str):
        return ", ".join(f'"{name}"' for name in legal)
    return (f'"{word}", or ' if word else "") + f"{legal[0]:g} to {legal[1]:g} {unit}".rstrip()


def _legal_value(key: str, value: object, one: Any) -> Value:
    """Return ``value`` as the type that the setting has; BiodanceError where it is not legal."""
    legal, word = one.metadata["legal"], one.metadata["word"]
    if not legal or isinstance(legal[0], str):
        if isinstance(value, str) and value and (not legal or value in legal):
            return value
    elif word and value == word:
        return word
    elif (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and isfinite(value)
        and legal[0] <= value <= legal[1]
    ):
        if not isinstance(one.default, int):
            return float(value)
        if float(value).is_integer():
            return int(value)
    whole = ", a whole number" if isinstance(one.default, int) else ""
    raise BiodanceError(
        f"The setting {key} = {value!r} is not legal ({one.metadata['meaning']}). Legal: "
        f"{_legal_words(one.metadata)}{whole}."
    )
