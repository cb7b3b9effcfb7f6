"""Hide causes in a simulated session, as asked for in words: ``plate_gain:target=Fz,gain=0.04``."""

from dataclasses import dataclass, replace

import numpy as np

from biodance.errors import BiodanceError
from biodance.records import Subject
from biodance.virtual_lab.faults import make_fault
from biodance.virtual_lab.laboratory import FIRST_VISIT, Visit
from biodance.virtual_lab.merge import load_on
from biodance.virtual_lab.person import AddedLoad, Person, make_person
from biodance.virtual_lab.protocol import Protocol


@dataclass(frozen=True)
class Hidden:
    """One cause to hide: its ``name``, where (``target``) and how large (``values`` by parameter, SI units; a place has three numbers)."""

    name: str
    target: str
    values: dict[str, tuple[float, ...]]


def parse(text: str) -> Hidden:
    """Read ``NAME:target=...,param=value,...``; a value of three numbers is written ``0.05;0;0``.

    Raises
    ------
    BiodanceError
        The text does not have that form; the message shows the part and an example.
    """
    name, _, rest = text.partition(":")
    values: dict[str, tuple[float, ...]] = {}
    target = ""
    for part in filter(None, rest.split(",")):
        key, equals, value = part.partition("=")
        if not equals:
            raise BiodanceError(f"--effect {text}: {part!r} is not parameter=value. Example: plate_gain:target=Fz,gain=0.04")
        if key == "target":
            target = value
            continue
        try:
            values[key] = tuple(float(number) for number in value.split(";"))
        except ValueError as error:
            raise BiodanceError(f"--effect {text}: {value!r} is not a number (or three, as 0.05;0;0), for {key}.") from error
    return Hidden(name, target, values)


def hide(
    hidden: tuple[Hidden, ...], subject: Subject, protocol: Protocol, *, seed: int, visit: Visit = FIRST_VISIT
) -> tuple[Visit, tuple[AddedLoad, ...]]:
    """Return the visit with the faults, and the loads that the person carries.

    Raises
    ------
    UnknownName
        A cause, target or channel does not exist.
    BiodanceError
        A parameter is missing, or a mass is not positive.
    """
    faults, loads = list(visit.faults), []
    person = make_person(subject, seed, tolerances=visit.tolerances, session=visit.number)
    for cause in hidden:
        if cause.name == "added_mass":
            loads.append(_load(cause, person))
            continue
        single = {key: value[0] for key, value in cause.values.items()}
        faults.append(make_fault(cause.name, cause.target, single, protocol))
    return replace(visit, faults=tuple(faults)), tuple(loads)


def _load(cause: Hidden, person: Person) -> AddedLoad:
    """Return a carried mass: ``mass`` kg on one of the 12 segments, ``place`` (3) m in its joint frame (beside the CoM if not given)."""
    unknown = set(cause.values) - {"mass", "place"}
    if unknown or "mass" not in cause.values or cause.values["mass"][0] <= 0:
        raise BiodanceError(f"Effect added_mass has mass (kg, > 0) and place (three numbers, m); got {cause.values}.")
    place = cause.values.get("place")
    if place is not None and len(place) != 3:
        raise BiodanceError(f"Effect added_mass: place has {len(place)} numbers; write three, as place=0;-0.1;0.05 (m, segment axes).")
    return load_on(person, cause.target, cause.values["mass"][0], place=None if place is None else np.array(place))
