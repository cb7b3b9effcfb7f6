"""Keys of session.toml set and taken out: what else stands there stays, comments and order included."""

import tomllib

import pytest

from biodance.app.sessions import changed_text
from biodance.errors import FileRefused

SCATTERED = """# top
[trials.a]
role = "fit" # why

[subject]
age = 3

[trials.b]
role = "fit"

[plates.plate1]
use = false
[markers]
map = {LASI = "left_asis"} # inline
"""


def expected(text: str, changes) -> dict:
    """The same by plain dictionaries; tables left empty are gone."""
    whole = tomllib.loads(text)
    for keys, value in changes:
        tables = [whole]
        for key in keys[:-1]:
            tables.append(tables[-1].setdefault(key, {}))
        if value is None:
            tables[-1].pop(keys[-1], None)
        else:
            tables[-1][keys[-1]] = value
        for table, key in list(zip(tables, keys, strict=True))[-2::-1]:
            if table[key] == {}:
                table.pop(key)
    return whole


@pytest.mark.parametrize("text", ["", SCATTERED, '[trials]\na = {role = "static"}\n', "subject.age = 3\n"])
@pytest.mark.parametrize(
    "changes",
    [
        [(["trials", "c", "role"], "static"), (["trials", "b", "role"], "validate")],
        [(["trials", "b", "role"], None)],
        [(["trials", "a", "role"], None), (["plates", "plate1", "use"], None)],
        [(["markers", "map"], {"A": "left_asis", "B b": "pelvis"}), (["devices", "left_foot"], 0.3)],
        [(["plates", "plate1", "corners_m"], [[0.1, 0.2, 0], [1, 2, 3], [1, 2, 3], [1, 2, 3]])],
        [(["trials", "x y", "leave_out"], [[1, 2, "right"]]), (["subject", "age"], 4), (["subject", "sex"], "F")],
        [(["markers", "map"], None), (["markers", "drop"], ["T10"])],
    ],
)
def test_what_is_set_and_taken_out_is_there_and_gone(text, changes):
    changed = changed_text(text, changes)
    assert tomllib.loads(changed) == expected(text, changes)
    assert ("# top" in changed) is ("# top" in text)


def test_an_empty_table_with_a_comment_stays():
    text = "[subject]\n# measured by Anna\nage = 3\n"
    assert changed_text(text, [(["subject", "age"], None)]) == "[subject]\n# measured by Anna\n"


@pytest.mark.parametrize("keys", [[], ["a", "b", "c", "d", "e"], ["subject", ""], ["subject", "age", "years"]])
def test_what_is_no_key_is_refused(keys):
    with pytest.raises(FileRefused, match="cannot be changed"):
        changed_text("[subject]\nage = 3\n", [(keys, 1)])
