"""Find the members of a family: one file each in a folder of biodance, entry points of other packages, objects given as
arguments.

A family of code is a folder of modules (``Family``); a family of data is a folder of files (``DataFamily``). Another
package joins by an entry point whose group is the name of the family, for example in its pyproject.toml::

    [project.entry-points."biodance.effects"]
    shaking_floor = "my_lab.shaking_floor:ShakingFloor"

Nothing is imported before a family is asked for its members.
"""

import importlib
import inspect
import pkgutil
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import MappingProxyType
from typing import Any, Generic, TypeAlias, TypeVar

from biodance.errors import BiodanceError, UnknownName
from biodance.library import PACKAGE, folder

Member = TypeVar("Member")
Chosen: TypeAlias = Iterable[str | Member] | Mapping[str, Member] | None
"""Names of members, objects, or both; a selection made before; None for all (`Family.choose`)."""


def missing_of(protocol: type) -> Callable[[object], tuple[str, ...]]:
    """Return a judge of members: which public names of ``protocol`` an object, class or module lacks."""
    needed = tuple(
        n for n in dict.fromkeys((*inspect.get_annotations(protocol), *vars(protocol))) if not n.startswith("_")
    )

    def judge(candidate: object) -> tuple[str, ...]:
        return tuple(name for name in needed if not hasattr(candidate, name))

    return judge


@dataclass(frozen=True)
class Family(Generic[Member]):
    """One family of code.

    Attributes
    ----------
    kind
        What one member is called in a sentence, for example "limit".
    group
        Name of the group of entry points, for example "biodance.limits".
    package
        Folder of biodance, for example "biodance.dance.limits". Its files whose name starts with ``_`` are helpers.
    provides
        The name that each file gives its member, for example "LIMIT"; "" where the module itself is the member.
    missing
        Which names an object lacks to be a member, () for a member (`missing_of` a Protocol).
    name_of
        The name of a member.
    """

    kind: str
    group: str
    package: str
    provides: str
    missing: Callable[[object], tuple[str, ...]]
    name_of: Callable[[Member], str]

    def members(self, given: Iterable[Member] = ()) -> Mapping[str, Member]:
        """Return all members by name: those of the folder, of the entry points, and those ``given``, in this order.

        Raises
        ------
        BiodanceError
            A file or an entry point cannot be imported or is no member, or two members have one name; the sentence says
            which, where, and what to do.
        """
        places = tuple(importlib.import_module(self.package).__path__), tuple(sys.path)
        own = tuple((member, _where(member)) for member in given)
        return self._by_name((*_found(self, *places), *own)) if own else _known(self, *places)

    def choose(self, chosen: "Chosen[Member]" = None) -> Mapping[str, Member]:
        """Return a selection: names choose from the family, objects join what is chosen (the whole family where no name
        is given).

        None is the whole family, an empty sequence nothing; a mapping is a selection that was made before, and returned
        as it is. The members keep the family's order, objects follow.

        Raises
        ------
        UnknownName
            There is no member of a chosen name; the message lists all.
        BiodanceError
            As for `members`; or an object that is given is no member.
        """
        if chosen is None:
            return self.members()
        if isinstance(chosen, Mapping):
            return chosen
        asked = tuple(chosen)
        names, given = (
            [item for item in asked if isinstance(item, str)],
            [item for item in asked if not isinstance(item, str)],
        )
        if given and not names:
            return self.members(given)
        family = self.members()
        for name in names:
            if name not in family:
                raise UnknownName.of(self.kind, name, tuple(family))
        kept = [(member, f"the {self.kind} of the family") for name, member in family.items() if name in names]
        return self._by_name((*kept, *((member, _where(member)) for member in given)))

    def judged(self, given: Iterable[Member]) -> Mapping[str, Member]:
        """Return objects by name, without the family; BiodanceError for one that is no member."""
        return self._by_name((member, _where(member)) for member in given)

    def _by_name(self, found: Iterable[tuple[Any, str]]) -> Mapping[str, Member]:
        """Return members with the place they come from by name; refuse who is none, and two of one name."""
        members: dict[str, Member] = {}
        places: dict[str, str] = {}
        for member, place in found:
            missing = self.missing(member)
            if missing:
                raise BiodanceError(
                    f"{_started(place)}: lacks {', '.join(missing)}, so it is no {self.kind}. "
                    f"Write what is missing as {self.package} describes."
                )
            name = self.name_of(member)
            if name in members:
                raise BiodanceError(_twice(self.kind, name, places[name], place))
            members[name], places[name] = member, place
        return MappingProxyType(members)


@dataclass(frozen=True)
class DataFamily:
    """One family of data files.

    Attributes
    ----------
    kind
        What one member is called in a sentence, for example "marker set".
    group
        Name of the group of entry points; each points at a `pathlib.Path` or str.
    folder
        Shipped folder, for example "anthropometry/marker_sets".
    suffix
        Suffix of a member's file; other files of the folder are none.
    """

    kind: str
    group: str
    folder: str
    suffix: str

    def shipped(self) -> Mapping[str, Path]:
        """Return the files in the folder of biodance by name."""
        first, _, rest = self.folder.partition("/")
        place = folder(first) / rest
        return _files_in(place, self.suffix, place.stat().st_mtime_ns)

    def files(self) -> Mapping[str, Path]:
        """Return the files of all members by name: the shipped ones, then those of the entry points.

        Raises
        ------
        BiodanceError
            An entry point cannot be imported or points at no such file, or two members have one name.
        """
        found = dict(self.shipped())
        for entry in _offered(self.group, tuple(sys.path)):
            path, place = _loaded(entry, self.kind), _place(entry, self.kind)
            if not isinstance(path, str | Path) or not str(path).endswith(self.suffix) or not Path(path).is_file():
                raise BiodanceError(
                    f"{_started(place)} points at {path!r}, expected the path of a {self.suffix} file. Correct or "
                    f"uninstall that package."
                )
            if entry.name in found:
                raise BiodanceError(_twice(self.kind, entry.name, str(found[entry.name]), place))
            found[entry.name] = Path(path)
        return MappingProxyType(found)

    def locate(self, name_or_path: str | Path) -> Path:
        """Return the file of a member: by its name, or a user's own by its path (whatever ends with ``suffix``).

        Raises
        ------
        UnknownName
            There is no member of that name; the message lists all, and says that a path is taken as well.
        BiodanceError
            As for `files`.
        """
        if str(name_or_path).endswith(self.suffix):
            return Path(name_or_path)
        files = self.files()
        if str(name_or_path) not in files:
            unknown = UnknownName.of(self.kind, str(name_or_path), tuple(files))
            raise UnknownName(f"{unknown} A file of your own is given by its path (*{self.suffix}).")
        return files[str(name_or_path)]


@cache
def _files_in(place: Path, suffix: str, _stamp: int) -> Mapping[str, Path]:
    """Return the files of a folder by name; the stamp of the folder makes an old answer stale."""
    return MappingProxyType({path.stem: path for path in sorted(place.glob(f"*{suffix}"))})


@cache
def _known(family: Family[Any], path: tuple[str, ...], packages: tuple[str, ...]) -> Mapping[str, Any]:
    """Return a family by name; another folder or sys.path makes the answer stale."""
    return family._by_name(_found(family, path, packages))


def _found(family: Family[Any], path: tuple[str, ...], packages: tuple[str, ...]) -> tuple[tuple[Any, str], ...]:
    found = [*_of_folder(family, path)]
    for entry in _offered(family.group, packages):  # a module stands for what it provides
        member = _loaded(entry, family.kind)
        if inspect.ismodule(member) and family.provides:
            member = getattr(member, family.provides, member)
        found.append((member, _place(entry, family.kind)))
    return tuple(found)


@cache
def _of_folder(family: Family[Any], path: tuple[str, ...]) -> tuple[tuple[Any, str], ...]:
    """Return the members in a family's folder ``path``, each with its file; BiodanceError for a file that is none."""
    return tuple(_of_module(family, info.name) for info in pkgutil.iter_modules(path) if not info.name.startswith("_"))


def _of_module(family: Family[Any], name: str) -> tuple[Any, str]:
    """Return the member that one file of the folder describes, and the file."""
    file = f"{family.package.replace('.', '/')}/{name}.py"
    try:
        module = importlib.import_module(f"{family.package}.{name}")
    except Exception as error:
        raise BiodanceError(
            f"{file}: cannot be imported ({_said(error)}). Correct the file or move it away."
        ) from error
    if family.provides and not hasattr(module, family.provides):
        raise BiodanceError(
            f"{file}: defines no {family.provides}, so it is no {family.kind}. Define it, let the file's name start "
            "with '_' if it is a helper, or move the file away."
        )
    return (getattr(module, family.provides) if family.provides else module), file


def _offered(group: str, path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    mine = (entry for entry in _entry_points(path) if entry.group == group)
    return tuple(sorted(mine, key=lambda entry: (entry.name, entry.value)))


@cache
def _entry_points(_path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """Return what all installed packages offer; ``_path`` is sys.path, whose change makes the answer stale."""
    every = entry_points()
    return tuple(entry for group in every.groups for entry in every.select(group=group))


def _loaded(entry: EntryPoint, kind: str) -> Any:
    """Return what an entry point refers to; BiodanceError names its distribution if that cannot be imported."""
    try:
        return entry.load()
    except Exception as error:
        raise BiodanceError(
            f"{_started(_place(entry, kind))} cannot be imported ({_said(error)}). Repair or uninstall that package."
        ) from error


def _place(entry: EntryPoint, kind: str) -> str:
    owner = f"{entry.dist.name} {entry.dist.version}" if entry.dist else "unknown"
    return f"the {kind} {entry.name!r} of the installed package {owner} ({entry.value})"


def _where(member: object) -> str:
    """Return where an object that was given as an argument is written."""
    named = member if isinstance(member, type) or inspect.ismodule(member) else type(member)
    return f"the object given ({getattr(named, '__module__', '')}.{named.__name__})".replace("(.", "(")


def _twice(kind: str, name: str, first: str, second: str) -> str:
    first = first.replace(f"{PACKAGE.parent}/", "")
    return f"Two of a family have one name: the {kind} {name!r} is {first} and again {second}. Rename one of them."


def _started(place: str) -> str:
    """Return a place as the beginning of a sentence; a file keeps its case."""
    return f"The{place[3:]}" if place.startswith("the ") else place


def _said(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
