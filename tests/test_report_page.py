"""The analyst's page: holds everything itself, reads well to a machine, is the same every time, and survives a
session without results.
"""

import base64
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from example_results import full_session, refused_session

from biodance.doctor import BROWSERS
from biodance.pipeline.attention import without_path
from biodance.pipeline.provenance import provenance
from biodance.pipeline.results import SessionResult
from biodance.report.figures.session import marker_figure, wrench_figure
from biodance.report.figures.solid import still_addresses
from biodance.report.figures.still import still_figure
from biodance.report.figures.style import svg_address
from biodance.report.pages.session import check_table, page
from biodance.report.wording import format_number, millimetres

TIME = "2026-01-01T00:00:00Z"
VOID = {"meta", "img", "link", "br", "hr"}


class Outline(HTMLParser):
    """Collects elements with their attributes and checks that every element is closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def outline(html: str) -> Outline:
    parser = Outline()
    parser.feed(html)
    assert parser.open == []
    return parser


def html_of(result: SessionResult, created: str = TIME) -> str:
    still = svg_address(still_figure(result.still)) if result.still else ""
    return page(result, provenance(result, created=created), stills=[still] if still else [])


@pytest.fixture(scope="module")
def full() -> str:
    return html_of(full_session())


def test_the_page_is_well_formed_and_labelled_for_a_screen_reader(full):
    elements = outline(full).elements
    assert ("html", {"lang": "en"}) in elements
    images = [attributes for tag, attributes in elements if tag == "img"]
    assert len(images) == 4
    assert all(len(image["alt"]) > 40 for image in images)
    tables = sum(tag == "table" for tag, _ in elements)
    assert tables == sum(tag == "caption" for tag, _ in elements) == 7
    assert all(attributes.get("scope") in ("col", "row") for tag, attributes in elements if tag == "th")


def test_the_page_asks_nothing_of_the_network(full):
    elements = outline(full).elements
    policy = next(a["content"] for t, a in elements if a.get("http-equiv") == "Content-Security-Policy")
    assert policy.startswith("default-src 'none'")
    assert not any(tag in ("script", "link", "iframe", "object") for tag, _ in elements)
    assert all(
        attributes["src"].startswith("data:image/svg+xml;base64,") for tag, attributes in elements if tag == "img"
    )
    assert not re.search(r"url\(|@import", full.split("<body>")[0])


def test_the_same_result_gives_the_same_characters(full):
    assert html_of(full_session()) == full
    assert html_of(full_session(), "2027-01-01T00:00:00Z").replace("2027-01-01", "2026-01-01") == full


def test_names_from_files_cannot_become_markup(full):
    assert "walk &lt;1&gt;" in full
    assert "walk <1>" not in full


def test_what_is_outside_its_limit_comes_first(full):
    assert (
        full.index("What needs a person")
        < full.index("<strong>gaps, walk &lt;1&gt;</strong>")
        < full.index("Quality checks")
    )


def test_a_trial_without_a_check_has_a_gap_in_the_table_of_checks():
    result = full_session()
    bare = replace(result.trials[0], checks=result.trials[0].checks[:1])
    columns, rows = check_table(replace(result, trials=(result.trials[0], bare)))
    assert columns == [("marker distance, RMS", "at most 20 mm"), ("gaps", "at most 2 %")]
    assert [[check and check.inside for check in checks] for _, checks in rows] == [[True, False], [True, None]]


def test_a_session_without_results_still_has_a_page_with_every_reason():
    html = html_of(refused_session())
    outline(html)
    for sentence in (
        "<strong>broken.c3d</strong>: is empty.",
        "No stature.",
        "no marker is known. Name a marker set.",
        "No plates.",
    ):
        assert sentence in html
    assert not re.search(r"\bnan\b", html, re.IGNORECASE)
    assert "<img" not in html


def test_a_marker_never_seen_has_no_bar():
    fit = full_session().trials[0].fit
    axes = marker_figure(fit).axes[0]
    labels = [label.get_text() for label in axes.get_xticklabels()]
    assert len(labels) == len(fit.names) - 1
    assert "M06" not in labels
    heights = [bar.get_height() for bar in axes.patches]
    assert heights == sorted(heights, reverse=True)
    assert heights[0] == pytest.approx(1000 * np.nanmax(fit.rms))


def test_frames_left_out_have_no_residual_and_are_hatched():
    comparison = full_session().trials[0].comparison
    residual = wrench_figure(comparison).axes[2]
    drawn = residual.lines[-1].get_ydata()
    assert np.array_equal(np.isfinite(drawn), comparison.used)
    expected = (comparison.measured - comparison.simulated)[comparison.used, 0]
    np.testing.assert_allclose(drawn[comparison.used], expected)
    spans = [(p.get_x(), p.get_x() + p.get_width()) for p in residual.patches]
    assert spans == [pytest.approx((0.0, 0.4)), pytest.approx((2.5, 2.99))]


def test_a_comparison_without_a_used_frame_can_be_drawn():
    comparison = full_session().trials[0].comparison
    nothing = replace(comparison, used=np.zeros(comparison.time.size, dtype=bool), rms=np.full(6, np.nan))
    svg = base64.b64decode(svg_address(wrench_figure(nothing)).split(",")[1])
    assert svg.startswith(b"<?xml")


@pytest.mark.parametrize("child", ["false", "true", "no-such-program"])
def test_a_child_that_dies_or_draws_nothing_leaves_the_drawing(monkeypatch, child):
    monkeypatch.setattr("biodance.report.figures.solid.sys.executable", child)
    still = full_session().still
    assert still_addresses([still]) == [svg_address(still_figure(still))]


def test_figures_carry_no_date():
    svg = base64.b64decode(svg_address(marker_figure(full_session().trials[0].fit)).split(",")[1]).decode()
    assert "<dc:date>" not in svg


@pytest.mark.parametrize(
    ("value", "text"), [(1.25, "1.2"), (-0.04, "0.0"), (-3.0, "−3.0"), (float("nan"), "–"), (None, "–")]
)
def test_numbers_read_like_numbers(value, text):
    assert format_number(value) == text


def test_a_file_is_named_once():
    assert without_path("/data/S1/a.c3d: is empty.", "a.c3d") == "is empty."
    assert without_path("The ratio is 1: 2.", "a.c3d") == "The ratio is 1: 2."


def test_metres_are_shown_in_millimetres():
    assert millimetres(0.0123) == "12.3"


def test_a_browser_shows_the_page_without_a_complaint(full, tmp_path):
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        pytest.skip("no chromium on this machine; biodance doctor says how to get it")
    (tmp_path / "page.html").write_text(full, encoding="utf-8")
    flags = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-background-networking",
        "--enable-logging=stderr",
        "--v=0",
    ]
    words = [
        browser,
        *flags,
        f"--user-data-dir={tmp_path / 'profile'}",
        "--dump-dom",
        f"file://{tmp_path / 'page.html'}",
    ]
    shown = subprocess.run(words, capture_output=True, text=True, timeout=60, check=True)
    assert shown.stdout.count("<img") == full.count("<img")
    assert "CONSOLE" not in shown.stderr
