"""All settings together, and how they are said: in TOML tables, or as ``filter.cutoff=6``."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from biodance.errors import BiodanceError, UnknownName
from biodance.settings.groups import (
    GENERAL,
    STANDARD_GRAVITY,
    CheckLimits,
    ContactRules,
    FilterSettings,
    GapSettings,
    Group,
    Hip,
    Setting,
    StandingRules,
    Value,
    number_field,
    word_field,
)


@dataclass(frozen=True)
class Settings(Group):
    """All that an analyst may choose, frozen; a value that is not legal is refused with the legal range.

    Parameters
    ----------
    table : str
        Table of segment inertial parameters: the prior of the identification, and what the body weighs before it.
    hip : {"harrington", "davis"}
        Regression of the hip joint centres in the static trial.
    joints : {"functional", "static"}
        Joint centres and axes from the movement (functional calibration), or from the static trial alone.
    gravity : float
        m/s² in the laboratory, along -z.
    outlier : float
        Share of the load that the plates carry around it, at least the body weight: frames in which table and plates
        differ by more are left out of the identification.
    filter : FilterSettings
        The low-pass of joint coordinates and forces.
    gaps : GapSettings
        Markers that were not seen for a while.
    contact : ContactRules
        When a foot may touch the ground, and when a plate is loaded.
    standing : StandingRules
        What counts as quiet standing on the plates.
    checks : CheckLimits
        The limits of the quality table.

    See Also
    --------
    read_session : Takes the settings from session.toml.

    Examples
    --------
    >>> import biodance
    >>> chosen = biodance.Settings().changed({"filter.cutoff": 6, "table": "dumas_2018"})
    >>> chosen.filter.cutoff
    6.0
    >>> chosen.changed({"filter.cutof": 6})
    Traceback (most recent call last):
        ...
    biodance.errors.UnknownName: 'filter.cutof' is not a setting. Did you mean 'filter.cutoff'? Legal: ...
    """

    name = GENERAL
    table: str = word_field(
        "de_leva_1996", (), "table of segment inertial parameters: what is known of the body beforehand"
    )
    hip: Hip = word_field(
        "harrington", ("harrington", "davis"), "regression of the hip joint centres in the static trial"
    )
    joints: Literal["functional", "static"] = word_field(
        "functional", ("functional", "static"), "joints from the movement, or static alone"
    )
    gravity: float = number_field(STANDARD_GRAVITY, 9.7, 9.9, "m/s²", "gravity in the laboratory, along -z")
    outlier: float = number_field(
        0.3,
        0.05,
        5.0,
        "",
        "share of the load (weight, or peak force) by which frames may differ from the table's prediction",
    )
    filter: FilterSettings = FilterSettings()
    gaps: GapSettings = GapSettings()
    contact: ContactRules = ContactRules()
    standing: StandingRules = StandingRules()
    checks: CheckLimits = CheckLimits()

    def __repr__(self) -> str:
        changed = [
            f"{one.key}={one.value!r}" for one, usual in zip(self.all(), USUAL.all(), strict=True) if one != usual
        ]
        return f"Settings({', '.join(changed)})"

    def all(self) -> tuple[Setting, ...]:
        """Return every setting with key, value, unit, meaning and legal range, in order.

        Returns
        -------
        tuple of Setting
            Named tuples ``(key, value, unit, meaning, legal)``.

        Examples
        --------
        >>> biodance.Settings().all()[0].key
        'table'
        """
        return (*self.rows(), *(row for group in self._groups().values() for row in group.rows()))

    def as_dict(self) -> dict[str, Value]:
        """Return dotted key -> value of every setting, as results.json keeps them.

        Returns
        -------
        dict
            Text or numbers, in the units that `all` tells.

        Examples
        --------
        >>> biodance.Settings().as_dict()["gravity"]
        9.80665
        """
        return {one.key: one.value for one in self.all()}

    def changed(self, changes: Mapping[str, object]) -> "Settings":
        """Return the settings with some of them changed.

        Parameters
        ----------
        changes : mapping
            Dotted keys (``{"filter.cutoff": 6}``) or tables (``{"filter": {"cutoff": 6}}``) to values.

        Returns
        -------
        Settings
            A new record; this one stays as it is.

        Raises
        ------
        UnknownName
            There is no such setting; the legal keys are named.
        BiodanceError
            A value is of the wrong type or out of its range.

        Examples
        --------
        >>> biodance.Settings().changed({"filter": {"cutoff": 6}})
        Settings(filter.cutoff=6.0)
        """
        flat, legal = flattened(changes), tuple(self.as_dict())
        for key in flat:
            if key not in legal:
                raise UnknownName.of("setting", key, legal)
        own: dict[str, Any] = {key: value for key, value in flat.items() if "." not in key}
        for name, group in self._groups().items():
            inner: dict[str, Any] = {
                key.partition(".")[2]: value for key, value in flat.items() if key.startswith(f"{name}.")
            }
            own |= {name: replace(group, **inner)} if inner else {}
        return replace(self, **own)

    def to_toml(self) -> str:
        """Return all settings as TOML, the way they may stand in session.toml, each with unit, meaning and legal range.

        Returns
        -------
        str
            The tables ``[settings]`` and ``[settings.filter]``, ...

        Examples
        --------
        >>> print(biodance.Settings().to_toml())  # doctest: +ELLIPSIS
        [settings]
        table = "de_leva_1996" # table of segment inertial parameters: ...
        """
        parts = {"settings": self.rows()} | {f"settings.{name}": group.rows() for name, group in self._groups().items()}
        return "\n".join("".join([f"[{name}]\n", *(_line(row) for row in rows)]) for name, rows in parts.items())

    def _groups(self) -> dict[str, Group]:
        return {name: value for name, value in vars(self).items() if isinstance(value, Group)}


USUAL = Settings()
"""The settings where nobody chose."""


def _line(row: Setting) -> str:
    value = f'"{row.value}"' if isinstance(row.value, str) else repr(row.value)
    unit = f"{row.unit}; " if row.unit else ""
    return f"{row.key.rpartition('.')[2]} = {value} # {unit}{row.meaning}; legal: {row.legal}\n"


def flattened(tables: Mapping[str, object], above: str = "") -> dict[str, object]:
    """Return the values of nested ``tables`` by their dotted keys."""
    out: dict[str, object] = {}
    for key, value in tables.items():
        out |= flattened(value, f"{above}{key}.") if isinstance(value, Mapping) else {f"{above}{key}": value}
    return out


def assignments(texts: Iterable[str]) -> dict[str, object]:
    """Return what texts such as ``filter.cutoff=6`` say, by dotted key; text that is a number is a number.

    Raises
    ------
    BiodanceError
        A text has no ``=``.
    """
    out: dict[str, object] = {}
    for text in texts:
        key, equals, value = (part.strip() for part in text.partition("="))
        if not (key and equals and value):
            raise BiodanceError(
                f"--set {text}: is no assignment. Write for example --set filter.cutoff=6; biodance settings prints "
                f"all."
            )
        out[key] = _value_of(value.strip("\"'"))
    return out


def _value_of(text: str) -> Value:
    try:
        return float(text)
    except ValueError:
        return text
