"""What README and guide say was measured stands in one table (docs/claims.toml), with the same value and with a command
that measures it anew.
"""

import re
import tomllib
from datetime import date
from pathlib import Path

import pytest

from benchmarks.__main__ import names

CHECKOUT = Path(__file__).resolve().parents[1]
DOCS = CHECKOUT / "docs"
CLAIMS = tomllib.loads((DOCS / "claims.toml").read_text(encoding="utf-8"))["claim"]
PAGES = [CHECKOUT / "README.md", *sorted((DOCS / "guide").glob("*.md"))]
COUNTED = re.compile(r"\b\d+ of \d+\b")
NUMBER = re.compile(r"(?<![\w.])(?<![A-Za-z]-)\d[\d.,]*(?!\w)")
MEASURED = re.compile(r"\]\((\.\./|docs/)?benchmarks/\w+\.md")
KEYS = {"page", "text", "figure", "value", "command", "data", "new", "commit", "date"}
each_claim = pytest.mark.parametrize("claim", CLAIMS, ids=[one["figure"][:40] for one in CLAIMS])


def page_of(claim: dict) -> Path:
    """Return the page on which a claim stands."""
    return CHECKOUT / claim["page"] if claim["page"] == "README.md" else DOCS / claim["page"]


def unclaimed(text: str, claims: list[dict]) -> list[str]:
    """Return numbers of a page that are measured and in no claim: "n of m" anywhere, and every number in the prose that
    links to a benchmark, and in the tables right behind it.
    """
    for claim in claims:
        text = text.replace(claim["text"], "")
    blocks = re.split(r"\n\s*\n", re.sub(r"```.*?```|\"[^\"\n]*\"", "", text, flags=re.DOTALL))
    found = [one for block in blocks for one in COUNTED.findall(block)]
    for block, behind in zip(blocks, [*blocks[1:], ""], strict=True):
        if MEASURED.search(block):
            table = behind if behind.startswith("|") else ""
            sentence = " ".join(one for one in re.split(r"(?<=[.:])\s+(?=[A-Z\[-])", block) if MEASURED.search(one))
            prose = re.sub(r"`[^`]*`|\]\([^)]*\)", " ", f"{sentence}\n{table}")
            found += NUMBER.findall(prose)
    return found


@each_claim
def test_a_claim_stands_in_its_page_with_its_value(claim: dict) -> None:
    assert set(claim) == KEYS
    assert claim["text"] in page_of(claim).read_text(encoding="utf-8")
    assert all(value in claim["text"] for value in claim["value"])
    assert isinstance(claim["date"], date)
    assert re.fullmatch("[0-9a-f]{7,8}", claim["commit"])


@each_claim
def test_a_claim_can_be_measured_anew(claim: dict) -> None:
    command = claim["command"].removeprefix("OMP_NUM_THREADS=1 ")
    if command.startswith("python -m benchmarks "):
        assert command.split()[3] in names()
    elif command.startswith("python -m pytest "):
        assert (CHECKOUT / command.split()[3]).is_file()
    else:
        assert command.startswith(("biodance ", "make "))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_no_measured_number_stands_outside_the_table(page: Path) -> None:
    mine = [claim for claim in CLAIMS if page_of(claim) == page]
    assert unclaimed(page.read_text(encoding="utf-8"), mine) == []


def test_a_number_that_was_changed_or_added_is_seen() -> None:
    claim = {"text": "right in 3 of 4 ([more](../benchmarks/x.md))"}
    page = "It is right in 3 of 4 ([more](../benchmarks/x.md)).\n"
    assert unclaimed(page, [claim]) == []
    assert unclaimed(page.replace("3 of 4", "4 of 4"), [claim])[0] == "4 of 4"
    assert unclaimed("Off by 3.2 mm ([more](../benchmarks/x.md)):\n\n| a | 1.5 |\n", []) == ["3.2", "1.5"]
    assert unclaimed("A limit of 5 mm, `--rate 100`.\n", []) == []
