"""A form for what one person can and may do, and the commented file that `biodance dance --limits` reads."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomlkit

from biodance.dance.problem.person import GRADES, PLAIN_MOVEMENTS, limits_in, plain
from biodance.errors import refuse_unknown
from biodance.library import folder, names, read_toml
from biodance.records import SIDES

_TEMPLATES = "protocols/limits"
_NOBODY = "nobody"  # Where the form begins with nothing filled in
_FILE = Path("the form")  # By what messages call what was filled in
_CANNOT = {
    "stand": "Stand",
    "stand on right leg": "Stand on the right leg alone",
    "stand on left leg": "Stand on the left leg alone",
    "turn": "Turn the trunk",
    "lift arms over shoulder height": "Lift arms over shoulder height",
}
_STRENGTHS = {name: name.capitalize() for name in ("arm", "shoulder", "elbow", "leg", "hip", "knee", "ankle", "trunk")}
_SIDED = ("at_most_deg", "strength")
_COMMENTS = {
    "care": "sentences for cards and page: who helps, pain, when to stop",
    "rest_after_s": "s of dancing after which the person rests (heart, breath, pain)",
    "cannot": "what the person cannot or may not do",
    "hold_frame": "hands that stay on a walking frame, a rail or bars on the plates",
    "max_speed_deg_s": "spasticity: no joint turns faster",
    "seat_height_m": "of the stool in the protocol chair; the feet hang",
    "at_most_deg": "degrees that a movement goes at most",
    "weight_bearing": "share of the body weight that a leg may bear; less than 0.55: protocol chair",
    "strength": 'share of what is usual for age and sex, or a grade as "grade 4"',
}
"""What stands beside a key that the template does not have."""


def limits_form() -> dict[str, Any]:
    """Return what the form asks, and what every template fills in, each side by itself."""
    return {
        "templates": {_NOBODY: {}, **{name: _by_side(read_toml(_path(name))) for name in names(_TEMPLATES)}},
        "movements": [
            {"key": key, "words": words, "isb": isb, "sided": not key.startswith("trunk")}
            for key, (words, isb, _) in PLAIN_MOVEMENTS.items()
            if words
        ],
        "strengths": [{"key": key, "words": said, "sided": key != "trunk"} for key, said in _STRENGTHS.items()],
        "cannot": _CANNOT,
        "grades": {word: share for word, share in GRADES.items() if share < 1},
        "sides": SIDES,
    }


def limits_text(template: str, values: Mapping[str, Any]) -> str:
    """Return the file of what was filled in (``values`` by the keys of the file, each side by itself): a template's,
    with its comments where they still hold.

    Raises
    ------
    UnknownName
        There is no such template, or no such key.
    BiodanceError
        A value is not legal; the message says which, and what would be.
    """
    legal = (_NOBODY, *names(_TEMPLATES))
    refuse_unknown("template of limits", template, legal)
    wanted = {key: _joined(value) if key in _SIDED else value for key, value in values.items()}
    wanted = {key: value for key, value in wanted.items() if value not in ("", [], {}, None)}
    limits_in(wanted, _FILE)
    document = tomlkit.parse(_begun(template))
    before = _by_side(document.unwrap())
    for key in [key for key in document if key not in wanted]:
        document.remove(key)
    for key, value in wanted.items():
        if key not in document or before.get(key) != values[key]:
            _put(document, key, value, before)
    return tomlkit.dumps(document)


def _path(template: str) -> Path:
    return folder("protocols") / "limits" / f"{template}.toml"


def _begun(template: str) -> str:
    """Return the text of a template; of nobody the first lines of one, which say what such a file is."""
    if template != _NOBODY:
        return _path(template).read_text(encoding="utf-8")
    first, *_ = names(_TEMPLATES)
    head = _path(first).read_text(encoding="utf-8").partition("\n\n")[0]
    return f"{head.replace(f' ({first})', '')}\n\n"


def _put(document: tomlkit.TOMLDocument, key: str, value: Any, before: Mapping[str, Any]) -> None:
    """Put a value into the ``document``, a table entry by entry, so that comments of what is the same stay."""
    if not isinstance(value, dict):
        new = key not in document
        document[key] = value
        if new and key in _COMMENTS:
            document[key].comment(_COMMENTS[key])
        return
    if key not in document:
        document.add(tomlkit.nl())
        made = tomlkit.table()
        made.comment(_COMMENTS[key])
        document.add(key, made)
    entries: Any = document[key]
    same = {name for name in entries if value.get(plain(name)) == entries[name]}
    for name in [name for name in entries if name not in same]:
        if plain(name) in value:
            entries[name] = value[plain(name)]
        else:
            entries.remove(name)
    there = {plain(name) for name in entries}
    for name, one in value.items():
        if name not in there:
            entries[name] = one


def _by_side(raw: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a file says with each side by itself: ``arm_lift`` of both becomes one of each."""
    sided = {key: raw[key].items() for key in _SIDED if key in raw}
    return dict(raw) | {
        key: {one: value for name, value in table for one in _sides_of(plain(name))} for key, table in sided.items()
    }


def _sides_of(name: str) -> list[str]:
    """Return the entries of the form for one of the file."""
    if name == "all":
        return [one for limb in ("arm", "leg") for one in _sides_of(limb)] + ["trunk"]
    whole = name.startswith(("trunk", *(f"{side}_" for side in SIDES)))
    return [name] if whole else [f"{side}_{name}" for side in SIDES]


def _joined(table: Any) -> Any:
    """Return a table of the form with what is the same on both sides said once, and of all once."""
    if not isinstance(table, dict):
        return table
    out: dict[str, Any] = {}
    for name, value in table.items():
        side, _, bare = name.partition("_")
        pair = [f"{one}_{bare}" for one in SIDES]
        if side in SIDES and table.get(pair[0]) == table.get(pair[1]):
            out[bare] = value
        else:
            out[name] = value
    if {"arm", "leg", "trunk"} <= set(out) and out["arm"] == out["leg"] == out["trunk"]:
        out = {"all": out["arm"], **{name: one for name, one in out.items() if name not in ("arm", "leg", "trunk")}}
    return out
