"""Hide causes in a simulated session, as asked for in words: ``plate_gain:target=Fz,gain=0.04``."""

from biodance.errors import BiodanceError
from biodance.records import Subject
from biodance.virtual_lab.causes import Hidden, Scene, conceal
from biodance.virtual_lab.laboratory import FIRST_VISIT, Visit
from biodance.virtual_lab.person import AddedLoad, make_person
from biodance.virtual_lab.protocol import Protocol


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
    """Return the visit with the causes, and the loads that the person carries.

    Raises
    ------
    UnknownName
        A cause, target or channel does not exist.
    BiodanceError
        A parameter is missing, or a mass is not positive.
    """
    scene = Scene(make_person(subject, seed, tolerances=visit.tolerances, session=visit.number), protocol, visit)
    for cause in hidden:
        scene = conceal(cause, scene)
    return scene.visit, scene.loads
