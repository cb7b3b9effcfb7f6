"""The documentation: decisions are dated records in one form, tutorials are the examples, built pages need no
network.
"""

import importlib.util
import re
import shutil
from pathlib import Path
from types import ModuleType

import pytest
from browser import BROWSER, Page

DOCS = Path(__file__).parents[1] / "docs"
RECORDS = sorted((DOCS / "decisions").glob("2*.md"))
FORM = re.compile(
    r"# [^\n]+[^.\n]\n\nDate: (\d{4}-\d{2}-\d{2})( \(commit [0-9a-f]{7}\))? *\nTopic: [A-Z][^\n]+\n\n"
    r"## Context\n\n.+\n\n## Decision\n\n.+\n\n## Measurement\n\n.+\n\n## Consequences\n\n.+\n\Z",
    re.DOTALL,
)
LONGEST = 120


def hook(name: str) -> ModuleType:
    """Return a hook of the site; skips where mkdocs, which hooks import, is not installed."""
    pytest.importorskip("mkdocs", reason="mkdocs is not installed: pip install '.[docs]'")
    spec = importlib.util.spec_from_file_location(name, DOCS / "hooks" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
def test_the_search_of_the_site_answers_from_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two pages under the site's own theme, plugins and scripts: the whole site takes a minute."""
    pytest.importorskip("mkdocs", reason="mkdocs is not installed: pip install '.[docs]'")
    from mkdocs.commands.build import build
    from mkdocs.config import load_config

    monkeypatch.setenv("NO_MKDOCS_2_WARNING", "1")
    docs, site = tmp_path / "docs", tmp_path / "site"
    (docs / "guide").mkdir(parents=True)
    (docs / "index.md").write_text("# First\n\nNothing.\n")
    (docs / "guide" / "gait.md").write_text("# Gait\n\nMargin of stability.\n")
    for name in ("site.css", "iframe-worker.js"):
        shutil.copy(DOCS / name, docs)
    own = {"nav": ["index.md", "guide/gait.md"], "plugins": ["search", "offline"], "exclude_docs": ""}
    own |= {"hooks": [str(DOCS / "hooks" / "offline.py")], "docs_dir": str(docs), "site_dir": str(site)}
    build(load_config(str(DOCS.parent / "mkdocs.yml"), **own))
    results = "[...document.querySelectorAll('.md-search-result__item a')].map((one) => one.href)"
    for name in ("index.html", "guide/gait.html"):
        with Page((site / name).as_uri()) as browser:
            x, y = browser.run(
                "(({x, y, width}) => [x + width / 2, y + 5])(document.querySelector("
                "'[data-md-component=search-query]').getBoundingClientRect())"
            )
            for kind in ("mousePressed", "mouseReleased"):
                browser.send("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
            browser.until("typeof __index !== 'undefined'", 60)
            for letter in "stability":
                browser.key(letter)
            (found,) = {one.split("#")[0].split("?")[0] for one in browser.until(f"{results}.length && {results}", 60)}
            assert found == (site / "guide" / "gait.html").as_uri()


@pytest.mark.parametrize("path", RECORDS, ids=lambda path: path.stem)
def test_a_decision_is_a_dated_record(path: Path) -> None:
    text = path.read_text()
    form = FORM.fullmatch(text)
    assert form is not None, "context, decision, measurement, consequences: see docs/decisions/README.md"
    assert path.name.startswith(form[1])
    assert max(len(line) for line in text.splitlines()) <= LONGEST


def test_every_decision_stands_in_the_index() -> None:
    page = (DOCS / "decisions" / "README.md").read_text()
    assert len(RECORDS) >= 45
    assert all(f"({path.name})" in page for path in RECORDS)
    assert page == hook("decisions").indexed(page, DOCS / "decisions"), "run python docs/hooks/decisions.py"


def test_every_link_between_pages_leads_to_a_file() -> None:
    made = ("reference/", "tutorials/")
    for page in [*DOCS.rglob("*.md"), *DOCS.parent.glob("*.md")]:
        for target in re.findall(r"\]\(([^)#\s:]+)[^):]*\)", page.read_text()):
            assert any(part in target for part in made) or (page.parent / target).exists(), f"{page}: {target}"


def test_every_test_that_a_page_names_exists() -> None:
    tests = Path(__file__).parent
    for page in [*DOCS.rglob("*.md"), *DOCS.parent.glob("*.md")]:
        text = page.read_text()
        for stem in set(re.findall(r"\b(test_\w+)\.py\b", text)):
            assert (tests / f"{stem}.py").exists(), f"{page}: {stem}.py"
        for stem, name in set(re.findall(r"\b(test_\w+)\.py::(test_\w+)", text)):
            assert f"def {name}(" in (tests / f"{stem}.py").read_text(), f"{page}: {stem}.py::{name}"


def test_every_example_is_a_tutorial() -> None:
    tutorials = hook("tutorials")
    contents = tutorials.contents()
    for script in tutorials.scripts():
        assert f"({script.stem}.md)" in contents
        code = tutorials.parts(script)[1]
        assert script.read_text().rstrip().endswith(code)
        assert code in tutorials.page(script)


def test_what_a_browser_would_fetch_is_seen() -> None:
    fetched = hook("offline").fetched
    assert fetched('<script src="https://cdn.example.org/a.js"></script>') == ["https://cdn.example.org/a.js"]
    assert fetched('<link rel="stylesheet" href="//fonts.example.org/css">') == ["//fonts.example.org/css"]
    assert fetched("a { background: url(http://example.org/a.png) }") == ["http://example.org/a.png"]
    assert (
        fetched(
            '<a href="https://doi.org/10.1109/TRO.2016.2583062">paper</a> <img src="a.png"> <link rel="icon" '
            'href="b.png">'
        )
        == []
    )
