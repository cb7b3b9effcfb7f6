"""Check the docstrings of the front door with numpydoc: every public name, with its public methods and properties."""

import inspect
import sys
import warnings
from collections.abc import Iterator

import biodance

LEFT_OUT = {
    "GL01",  # text starts on the line of the quotes, as ruff's D212 has it
    "GL02",
    "GL08",  # a method without docstring is ruff's business (D102)
    "SA01",  # See Also only where there is something to see
    "SA04",
    "ES01",  # an extended summary only where there is more to say
    "SS06",  # a summary may run over two lines where shape and unit need the room
    "PR08",  # a description may start with a unit: "(T, 6) N"
    "RT02",  # a tuple of one thing is named by its type
    "RT04",
    "YD01",
}
"""Codes of numpydoc.validate that the house's style answers otherwise."""


def public() -> Iterator[tuple[str, object]]:
    """Yield every name of the front door, and the public methods and properties that its classes have of their own."""
    for name in biodance.__all__:
        thing = biodance.front_door(name)
        home = f"{thing.__module__}.{thing.__qualname__}"
        yield home, thing
        if inspect.isclass(thing):
            own = [key for cls in thing.__mro__ if cls.__module__.startswith("biodance") for key in vars(cls)]
            fields = getattr(thing, "__dataclass_fields__", {})
            yield from (
                (f"{home}.{key}", getattr(thing, key)) for key in own if not key.startswith("_") and key not in fields
            )


def faults() -> list[str]:
    """Return one line for every fault of a docstring."""
    from numpydoc.validate import validate

    found = []
    for name, thing in public():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            said = validate(name)
        exempt = LEFT_OUT if callable(thing) else LEFT_OUT | {"EX01"}
        found += [f"{name}: {code} {text}" for code, text in said["errors"] if code not in exempt]
    return found


if __name__ == "__main__":
    lines = faults()
    sys.stdout.writelines(f"{line}\n" for line in lines)
    sys.exit(bool(lines))
