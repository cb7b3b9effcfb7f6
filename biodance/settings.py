"""What an analyst may choose: one frozen record, checked at birth, that travels with every trial and stands whole in
every result. Said in ``[settings]`` of session.toml, by ``--set filter.cutoff=6``, or when a session is read. Also
the one place of standard gravity.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from math import isfinite
from typing import Any, ClassVar, Literal, NamedTuple, TypeAlias

from biodance.errors import BiodanceError, UnknownName

Value: TypeAlias = str | int | float
GENERAL = "general"


def number_field(default: float, low: float, high: float, unit: str, meaning: str, *, word: str = "") -> Any:
    """Return the field of a number from ``low`` to ``high``; a ``word`` is the default and legal, too."""
    return field(
        default=word or default, metadata={"legal": (low, high), "unit": unit, "meaning": meaning, "word": word}
    )


def word_field(default: str, legal: tuple[str, ...], meaning: str) -> Any:
    """Return the field of a word; an empty ``legal`` leaves the choice to whom it concerns."""
    return field(default=default, metadata={"legal": legal, "unit": "", "meaning": meaning, "word": ""})


class Setting(NamedTuple):
    """One setting: dotted ``key``, ``value``, ``unit`` ("" = none), ``meaning``, ``legal`` values in words."""

    key: str
    value: Value
    unit: str
    meaning: str
    legal: str


@dataclass(frozen=True)
class Group:
    """Settings that belong together, checked at birth; a whole number where a float is meant becomes one."""

    name: ClassVar[str]

    def __post_init__(self) -> None:
        for one in fields(self):
            if "legal" in one.metadata:
                value = _legal_value(_key(self.name, one.name), getattr(self, one.name), one)
                object.__setattr__(self, one.name, value)

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


STANDARD_GRAVITY = 9.80665
"""m/s² (CGPM 1901); 1 kilogram-force is so many newtons."""
COP_FORCE = 20.0
"""N: with less vertical force on a plate its centre of pressure has no meaning."""
FORCE_DOWN = 20.0
"""N of vertical force from which a foot counts as down (as Zeni 2008, doi:10.1016/j.gaitpost.2007.07.007)."""
SHORTEST_CONTACT = 0.05
"""s: a shorter contact of a foot, or a shorter time without, is noise."""
TOUCH_FORCE = 30.0
"""N: a plate that carries less over 0.1 s is only trembling; its readings decide nothing about its sign or zero."""

Hip: TypeAlias = Literal["harrington", "davis"]
FilterKind: TypeAlias = Literal["butterworth", "critically_damped"]


@dataclass(frozen=True)
class FilterSettings(Group):
    """The low-pass of joint coordinates and forces, forwards and backwards (no delay).

    Without a cut-off each trial has the one at which its filtered markers lie nearest to the path of rigid segments
    (docs/decisions/2026-11-22-filtering.md). The critically damped one does not overshoot (Robertson & Dowling 2003,
    doi:10.1016/S1050-6411(03)00080-4). Another cut-off for the forces than for the joint coordinates appears in the
    residual.
    """

    name = "filter"
    kind: FilterKind = word_field(
        "butterworth", ("butterworth", "critically_damped"), "low-pass of joint coordinates and forces"
    )
    order: int = number_field(5, 1, 10, "", "order of one of its two passes")
    cutoff: float | Literal["auto"] = number_field(
        0.0,
        1.0,
        100.0,
        "Hz",
        "frequency at which both passes together are 3 dB down; auto: what each trial asks for",
        word="auto",
    )
    force_cutoff: float | Literal["same"] = number_field(
        0.0, 1.0, 500.0, "Hz", "the same for the forces of the plates", word="same"
    )


@dataclass(frozen=True)
class GapSettings(Group):
    """Markers that were not seen for a while; a longer gap is only filled where its segment's other markers tell."""

    name = "gaps"
    bridged: float = number_field(0.2, 0.0, 2.0, "s", "longest gap of a marker that a spline bridges")
    often: float = number_field(10.0, 0.0, 100.0, "%", "share of frames from which on an unseen marker is warned of")


@dataclass(frozen=True)
class ContactRules(Group):
    """When a foot may touch the ground, and when a plate is loaded."""

    name = "contact"
    height: float = number_field(
        0.04, 0.005, 0.2, "m", "a point of the sole lower than this over a surface may touch it ..."
    )
    speed: float = number_field(0.8, 0.05, 3.0, "m/s", "... where it is also slower than this")
    around: float = number_field(0.05, 0.0, 0.5, "s", "time before and after that in which it may touch, too")
    still: float = number_field(0.15, 0.01, 1.0, "m/s", "a foot rests where its whole sole is slower than this ...")
    lasting: float = number_field(0.1, 0.02, 2.0, "s", "... for this long")
    force: float = number_field(20.0, 1.0, 200.0, "N", "a plate that carries less vertical force is not loaded")
    loaded: float = number_field(
        0.05, 0.0, 0.5, "", "share of the trial's largest vertical force from which a plate is loaded"
    )
    pressed: float = number_field(
        0.2, 0.0, 0.9, "", "the same, from which its centre of pressure is held against the soles"
    )
    outside: float = number_field(0.02, 0.0, 0.2, "m", "distance of the centre of pressure from the soles that is said")


@dataclass(frozen=True)
class StandingRules(Group):
    """What counts as quiet standing on the plates."""

    name = "standing"
    force: float = number_field(100.0, 20.0, 500.0, "N", "nobody stands on plates that carry less vertical force")
    sway: float = number_field(0.03, 0.005, 0.2, "", "share of its median within which the vertical force stays")
    shortest: float = number_field(0.4, 0.1, 30.0, "s", "quiet standing lasts at least this long")
    still: float = number_field(0.03, 0.002, 0.2, "m", "the typical marker stays within this")


@dataclass(frozen=True)
class CheckLimits(Group):
    """The limits of the quality table; what is outside needs a person, nothing is left out for it.

    The RMS marker distance follows OpenSim's user guide; the mass is shoes, clothes and a meal, beyond the 95 %
    interval of the weighing. Forces, the largest marker distance and those of trunk and head are what clean real
    sessions leave, with a margin: 79 trials of 12 public laboratories
    (docs/decisions/2026-11-21-data-quality-checks.md). Hicks et al. 2015 (doi:10.1115/1.4029304) ask 5 % of the
    forces of a walk, of models with residual actuators at the pelvis.
    """

    name = "checks"
    mass: float = number_field(2.0, 0.1, 50.0, "%", "mass on the plates against the declared mass")
    marker_rms: float = number_field(0.020, 0.001, 0.2, "m", "distance of the markers to the model, RMS")
    marker_largest: float = number_field(0.110, 0.002, 1.0, "m", "distance of the markers to the model, largest")
    marker_legs: float = number_field(0.015, 0.001, 0.2, "m", "distance of the markers of legs and pelvis, RMS")
    marker_trunk: float = number_field(0.040, 0.001, 0.2, "m", "distance of the markers of the trunk, RMS")
    marker_arms: float = number_field(0.020, 0.001, 0.2, "m", "distance of the markers of the arms, RMS")
    marker_head: float = number_field(0.030, 0.001, 0.2, "m", "distance of the markers of the head, RMS")
    gaps: float = number_field(5.0, 0.0, 100.0, "%", "marker samples not seen")
    open: float = number_field(1.0, 0.0, 100.0, "%", "frames in which the markers seen do not fix the posture")
    seconds: float = number_field(
        0.5, 0.0, 60.0, "s", "least time of a trial in which the plates measure all ground contact"
    )
    force: float = number_field(8.0, 0.1, 100.0, "%", "RMS difference of measured and simulated force, of body weight")
    force_moving: float = number_field(
        40.0, 0.0, 100.0, "%", "or this share of the RMS by which the measured force moves about the weight, if more"
    )
    standing: float = number_field(
        0.050, 0.001, 0.5, "m", "mean centre of mass against mean centre of pressure, standing"
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
        flat, legal = _flattened(changes), tuple(self.as_dict())
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


def _flattened(tables: Mapping[str, object], above: str = "") -> dict[str, object]:
    """Return the values of nested ``tables`` by their dotted keys."""
    out: dict[str, object] = {}
    for key, value in tables.items():
        out |= _flattened(value, f"{above}{key}.") if isinstance(value, Mapping) else {f"{above}{key}": value}
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
