"""session.toml changed key by key: comments stay, what is not legal is refused before it is written, and every state
that the file ever had is kept and can be had again.
"""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from threading import Lock
from typing import Any

import tomlkit
from tomlkit.container import Container
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AbstractTable

from biodance.errors import BiodanceError, FileRefused
from biodance.lab.plain_text import write_whole
from biodance.lab.session.file import check_session_text
from biodance.lab.session.results_folder import made_folder

KeyChange = tuple[Sequence[str], Any]
"""Where in session.toml, as ``("subject", "mass_kg")``, and the new value; None takes the key out."""
_DEEPEST = 4


class ChangedElsewhereError(BiodanceError):
    """session.toml is not as the one who wants to change it has seen it."""


class SessionText:
    """The session.toml of the session in ``folder``, with all states that it had in the folder ``history``.

    States are files ``0001.toml``, ... in the order in which they were; none is ever removed. `undo` goes back along
    them and `redo` forth; a change after `undo` adds the state gone back to, and then the new one.
    """

    def __init__(self, folder: Path, history: Path) -> None:
        self.path, self._history, self._lock = folder / "session.toml", history, Lock()
        self._at: int | None = None

    @property
    def text(self) -> str:
        """What the file says; "" where there is none."""
        try:
            return self.path.read_bytes().decode("utf-8-sig") if self.path.exists() else ""
        except UnicodeDecodeError as error:
            raise FileRefused(f"{self.path}: is no text in UTF-8, so not valid TOML. Save it as UTF-8.") from error
        except OSError as error:
            raise FileRefused(f"{self.path}: cannot be opened ({error.strerror}). Check the path.") from error

    @property
    def revision(self) -> str:
        """What changes whenever the file does."""
        content = self.path.read_bytes() if self.path.is_file() else b""
        return hashlib.sha256(content).hexdigest()[:16]

    @property
    def steps(self) -> tuple[bool, bool]:
        """Whether there is a state to go back to, and one to go forth to."""
        states, at = self._states(), self._position()
        changed = bool(states) and _read(states[at]) != self.text
        return at > 0 or changed, at < len(states) - 1 and not changed

    def change(self, changes: Sequence[KeyChange], revision: str) -> None:
        """Change keys of the file, which must be as at the ``revision``; comments and order stay.

        Raises
        ------
        ChangedElsewhereError
            It is not.
        BiodanceError
            What would stand there is not legal: nothing is written.
        """
        with self._lock:
            self._same(revision)
            self._write(changed_text(self.text, changes))

    def replace(self, text: str, revision: str) -> None:
        """Write another text, as `change`."""
        with self._lock:
            self._same(revision)
            self._write(text)

    def undo(self, revision: str) -> None:
        """Go back to the state before; nothing where there is none."""
        with self._lock:
            self._same(revision)
            self._keep()
            self._go(self._position() - 1)

    def redo(self, revision: str) -> None:
        """Go forth to the state that was undone; nothing where there is none."""
        with self._lock:
            self._same(revision)
            self._go(self._position() + 1)

    def _same(self, revision: str) -> None:
        if revision != self.revision:
            raise ChangedElsewhereError(
                f"{self.path.name} was changed elsewhere in the meantime. It is shown as it is now; make your change "
                f"again."
            )

    def _write(self, text: str) -> None:
        check_session_text(self.path, text)
        if text == self.text:
            return
        self._keep()
        if self._position() < len(self._states()) - 1:
            self._add(self.text)
        self._add(text)
        self._put(text)

    def _keep(self) -> None:
        """Keep what stands there now as the last state, unless it is the one that was written here."""
        states, now = self._states(), self.text
        if not states or _read(states[self._position()]) != now:
            self._add(now)

    def _add(self, text: str) -> None:
        number = len(self._states()) + 1
        write_whole(made_folder(self._history) / f"{number:04}.toml", text.encode())
        self._at = number - 1

    def _go(self, at: int) -> None:
        states = self._states()
        if 0 <= at < len(states):
            self._put(_read(states[at]))
            self._at = at

    def _put(self, text: str) -> None:
        if text:
            write_whole(self.path, text.encode(), over=True)
        else:
            self.path.unlink(missing_ok=True)  # the state of no file; an empty one says no more

    def _states(self) -> list[Path]:
        return sorted(self._history.glob("*.toml"))

    def _position(self) -> int:
        return len(self._states()) - 1 if self._at is None else self._at


def _read(path: Path) -> str:
    return path.read_bytes().decode("utf-8")


def changed_text(text: str, changes: Sequence[KeyChange]) -> str:
    """Return a TOML text with keys set or taken out; all else, comments included, is as before. FileRefused where it is
    no TOML, or a change is about a key inside what is no table.
    """
    try:
        document = tomlkit.parse(text)
        for keys, value in changes:
            _set(document, list(keys), value)
        return tomlkit.dumps(document)
    except (TOMLKitError, TypeError, ValueError) as error:
        raise FileRefused(f"session.toml: cannot be changed ({error}). Correct it as text first.") from error


def _set(document: Container, keys: list[str], value: Any) -> None:
    if not 1 <= len(keys) <= _DEEPEST or not all(isinstance(key, str) and key for key in keys):
        raise ValueError(f"{keys!r} is no key")
    if value is None:
        return _take_out(document, keys)
    table: Any = document
    for depth, key in enumerate(keys[:-1]):
        if key not in table:
            table[key] = tomlkit.table(is_super_table=depth < len(keys) - 2)
        table = table[key]
    table[keys[-1]] = _inline(value)
    return None


def _inline(value: Any) -> Any:
    """Return a value as it is written on one line, whatever it holds."""
    if isinstance(value, list):
        array = tomlkit.array()
        array.extend(_in_braces(one) if isinstance(one, dict) else _inline(one) for one in value)
        return array
    return tomlkit.item(value)


def _in_braces(value: dict[str, Any]) -> Any:
    table = tomlkit.inline_table()
    table.update(value)
    return table


def _take_out(document: Container, keys: list[str]) -> None:
    """Take a key out, and tables that hold nothing more."""
    tables: list[Any] = [document]
    for key in keys[:-1]:
        if key not in tables[-1]:
            return
        tables.append(tables[-1][key])
    for table, key in zip(reversed(tables), reversed(keys), strict=True):
        inner = table.get(key)
        if key == keys[-1] and table is tables[-1]:
            table.pop(key, None)
        elif isinstance(inner, AbstractTable) and not inner and not tomlkit.dumps(inner.value).strip():
            table.pop(key)  # Empty, and no comment stands in it
