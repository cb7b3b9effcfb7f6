"""The analyst's page: holds everything itself, reads well to a machine, is the same every time, and survives a
session without results.
"""

import base64
import hashlib
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from example_results import full_session, html_of, refused_session

from biodance.doctor import BROWSERS
from biodance.records.attention import without_path
from biodance.report.figures.session import marker_figure, wrench_figure
from biodance.report.figures.vector import STEPS, envelope, round_ticks
from biodance.report.pages.session import check_table, key_figures
from biodance.report.wording import format_number, millimetres

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


@pytest.fixture(scope="module")
def full() -> str:
    return html_of(full_session())


def test_the_page_is_well_formed_and_labelled_for_a_screen_reader(full):
    elements = outline(full).elements
    assert ("html", {"lang": "en"}) in elements
    drawn = [attributes for tag, attributes in elements if attributes.get("role") in ("img", "group")]
    assert len(drawn) == 2 + 2 + 1 + 12  # standing, two views, six channels with their differences
    assert all(attributes["aria-label"] for attributes in drawn)
    tables = sum(tag == "table" for tag, _ in elements)
    assert tables == sum(tag == "caption" for tag, _ in elements) == 6
    assert all(attributes.get("scope") in ("col", "row") for tag, attributes in elements if tag == "th")


def test_the_page_asks_nothing_of_the_network(full):
    elements = outline(full).elements
    policy = next(a["content"] for t, a in elements if a.get("http-equiv") == "Content-Security-Policy")
    assert policy.startswith("default-src 'none'")
    assert not any(tag in ("link", "iframe", "object", "img") or "src" in a for tag, a in elements)
    assert all(a["href"].startswith("#") for _, a in elements if "href" in a)
    assert not re.search(r"url\(|@import", full.split("<body>")[0])


def test_every_entry_of_the_contents_has_its_section(full):
    elements = outline(full).elements
    there = [a["id"] for _, a in elements if "id" in a]
    assert len(there) == len(set(there))
    entries = [a["href"].removeprefix("#") for tag, a in elements if tag == "a"]
    assert entries == [where for tag, a in elements if tag == "section" and (where := a.get("id")) != "verdict"]


def test_the_key_figures_say_the_worst_and_its_limit():
    tiles = {tile.what: (tile.value, tile.inside) for tile in key_figures(full_session())}
    assert tiles == {"Mass on the plates": ("65.20 kg", True), "Markers to the body": ("11.0 mm", True)}


def test_a_printed_page_says_whose_it_is_and_when(tmp_path):
    (tmp_path / "session.toml").write_text('[session]\ndate = 2026-03-05\nlab = "Gait </style> \\"lab\\""\n')
    (tmp_path / "walk <1>.Trial.enf").write_text("[TRIAL_INFO]\nDESCRIPTION=barefoot\n")
    result = full_session()
    html = html_of(replace(result, session=replace(result.session, folder=tmp_path)))
    style = re.search(r"<style>(.*?)</style>", html, re.DOTALL).group(1)
    assert "date 2026-03-05 · lab Gait" in style
    assert "condition barefoot" in style
    assert "counter(page)" in style
    assert "<dd>barefoot</dd>" in html


def test_only_the_page_s_own_scripts_may_run(full):
    policy = next(a["content"] for _, a in outline(full).elements if a.get("http-equiv") == "Content-Security-Policy")
    scripts = re.findall(r"<script>(.*?)</script>", full, re.DOTALL)
    hashes = [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in scripts]
    assert re.findall(r"sha256-([^']+)'", policy) == hashes
    assert "unsafe" not in policy.split("script-src")[1].split(";")[0]


def test_the_same_result_gives_the_same_characters(full):
    assert html_of(full_session()) == full
    assert html_of(full_session(), "2027-01-01T00:00:00Z").replace("2027-01-01", "2026-01-01") == full


def test_names_from_files_cannot_become_markup(full):
    assert "walk &lt;1&gt;" in full
    assert "walk <1>" not in full


def test_what_is_outside_its_limit_comes_first(full):
    assert (
        full.index("What needs a person")
        < full.index("<strong>Gaps, walk &lt;1&gt;</strong>")
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
    assert "<svg" not in html


def test_a_marker_never_seen_has_no_bar():
    fit = full_session().trials[0].fit
    rows = re.findall(
        r"<li><span>(.*?)</span><i style=\"--b:(.*?)%;--t:(.*?)%\"></i><b>(.*?) mm</b>", marker_figure(fit)
    )
    assert len(rows) == len(fit.names) - 1
    assert "M06" not in [name for name, *_ in rows]
    told = [float(text) for *_, text in rows]
    assert told == sorted(told, reverse=True)
    assert told[0] == pytest.approx(1000 * np.nanmax(fit.rms), abs=0.05)
    name, bar, tick, _ = rows[3]
    worst = fit.max[fit.names.index(name)] / np.nanmax(fit.max)
    assert (float(bar), float(tick)) == pytest.approx((100 * worst / 2.2, 100 * worst), abs=0.1)


def read_back(svg: str, name: str) -> np.ndarray:
    """Return the (time, value) pairs of the curve ``name`` in a panel, as the page's script reads them."""
    x, y = (np.array(found.split(), dtype=float) for found in re.search(r'data-x="(.*?)" data-y="(.*?)"', svg).groups())
    moves = re.search(rf'data-name="{name}"[^>]* d="(.*?)"', svg).group(1)
    out = []
    for start, steps in re.findall(r"M([^lh]*)(?:l([^M]*)|h0)", moves):
        relative = np.array(re.findall(r"-?\d+", steps), dtype=float).reshape(-1, 2)
        out.append(np.cumsum(np.vstack([np.array(start.split(), dtype=float), relative]), axis=0))
    across, down = np.concatenate(out).T
    return np.stack([x[0] + np.ptp(x) * across / STEPS, y[0] + np.ptp(y) * (1 - down / STEPS)], axis=1)


def panels(html: str) -> list[str]:
    return re.findall(r'<svg class="panel".*?</svg><g.*?</svg>', html, re.DOTALL)


def test_frames_left_out_have_no_residual_and_are_grey():
    comparison = full_session().trials[0].comparison
    curves, residual = panels(wrench_figure(comparison))[:2]
    drawn = read_back(residual, "with the table")
    used, low_high = comparison.used, re.search(r'data-y="(\S+) (\S+)"', residual).groups()
    step = np.ptp(np.array(low_high, dtype=float)) / STEPS
    np.testing.assert_allclose(drawn[:, 0], comparison.time[used], atol=0.001)
    expected = (comparison.measured - comparison.simulated)[used, 0]
    np.testing.assert_allclose(drawn[:, 1], expected, atol=step)
    assert len(read_back(curves, "measured")) == comparison.time.size
    spans = np.array(re.findall(r'class="out" x="(\d+)" y="0" width="(\d+)"', residual), dtype=float)
    seconds = np.stack([spans[:, 0], spans.sum(axis=1)], axis=1) * 2.99 / STEPS
    assert seconds == pytest.approx(np.array([[0.0, 0.4], [2.5, 2.99]]), abs=0.001)


def test_a_comparison_without_a_used_frame_can_be_drawn():
    comparison = full_session().trials[0].comparison
    nothing = replace(comparison, used=np.zeros(comparison.time.size, dtype=bool), rms=np.full(6, np.nan))
    assert len(panels(wrench_figure(nothing))) == 12


def test_a_long_curve_keeps_its_highest_and_lowest_values():
    values = np.sin(np.arange(90000) / 40)
    values[41234], values[70000], values[50:900] = 7.0, -9.0, np.nan
    chosen = envelope(values)
    assert len(chosen) <= 1200
    assert {41234, 70000} <= set(chosen.tolist())
    assert np.all(np.diff(chosen) > 0)


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (0.0, 1.0, ["0.0", "0.5", "1.0"]),
        (-37.0, 61.0, ["0", "50"]),
        (-0.04, 0.05, ["0.00", "0.05"]),
        (99.0, 101.0, ["99", "100", "101"]),
    ],
)
def test_ticks_are_round_numbers(low, high, words):
    assert [text for _, text in round_ticks(low, high, 3)] == words


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
    assert shown.stdout.count('class="cursor') == full.count('class="plot"') - 2  # all but the two of the standing
    assert "CONSOLE" not in shown.stderr
