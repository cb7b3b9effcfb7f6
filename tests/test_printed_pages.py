"""What a browser makes of a page: the axis holds what is drawn, and print has its pages, numbers and colours."""

import base64
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from browser import BROWSER, Page

from biodance.cli import run
from biodance.cli.shared import DONE, NEEDS_A_PERSON
from biodance.display import BLUE
from biodance.report.figures.vector import Curve, CurveFigure, Strip, Stroke
from biodance.report.pages.template import template_text

pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
TIME = np.linspace(0.0, 10.0, 201)


def written(folder: Path, body: str, style: str) -> str:
    page = folder / "page.html"
    script = template_text("curves.js")
    page.write_text(f"<!doctype html><style>{style}</style>{body}<script>{script}</script>", encoding="utf-8")
    return page.as_uri()


def test_a_part_of_the_time_still_shows_the_whole_band(tmp_path):
    used = (TIME > 4.0) & (TIME < 5.0)
    wide = Curve("hip", np.ones(TIME.size), Stroke(BLUE), half_width=np.full(TIME.size, 7.0))
    figure = CurveFigure(TIME, [[Strip("moment (N·m)", [wide])]], "about", used)
    sheet = template_text("page.css") + template_text("curves.css")
    with Page(written(tmp_path, figure.html(), sheet)) as browser:
        inside = """(() => { const seen = document.querySelector('.plot').viewBox.baseVal;
            const band = document.querySelector('.band').getBBox();
            return [seen.width, band.y - seen.y, seen.y + seen.height - band.y - band.height]; })()"""
        width, above, below = browser.run(inside)
        assert width < 1000  # a part of the time, and of its 4000 steps
        assert min(above, below) >= 0
        numbers = "[...document.querySelectorAll('text[text-anchor=end]')].map(one => one.textContent)"
        assert len(browser.run(numbers)) >= 2


KEPT = """new Promise((done) => {
    URL.createObjectURL = (blob) => { blob.text().then(done); return "data:,"; };
    document.querySelector('.zoom button[aria-label*="WHAT"]').click();
})"""
"""What a button of a figure saves."""


def test_a_figure_is_saved_as_it_is_seen_and_its_values_as_a_table(tmp_path):
    curves = [Curve("right", TIME**2, Stroke(BLUE)), Curve("left", TIME, Stroke(BLUE))]
    figure = CurveFigure(TIME, [[Strip("moment (N·m)", curves)]], "about")
    with Page(written(tmp_path, figure.html(), template_text("curves.css"))) as browser:
        browser.run("document.querySelector('.legend button[data-name=left]').click()")
        drawn = ElementTree.fromstring(browser.run(KEPT.replace("WHAT", "SVG")))
        assert {"moment (N·m)", "right"} <= {one.text for one in drawn.iter("{http://www.w3.org/2000/svg}text")}
        assert "non-scaling-stroke" in drawn[0].text
        header, *rows = browser.run(KEPT.replace("WHAT", "CSV")).strip().split("\n")
        assert header == "panel,curve,along,value"
        assert len(rows) == TIME.size
        panel, curve, along, value = rows[100].rsplit(",", 3)
        assert (panel, curve) == ('"moment (N·m)"', '"right"')
        assert (float(along), float(value)) == pytest.approx((5.0, 25.0), abs=0.05)


def test_bars_and_legends_are_printed_with_their_colours(tmp_path):
    body = '<ul class="bars"><li><span>LASI</span><i style="--b:40%;--t:90%"></i><b>4 mm</b></li></ul>'
    body += '<i class="swatch in"></i><table class="heat"><tr><td>5</td></tr></table>'
    with Page(written(tmp_path, body, template_text("page.css") + template_text("curves.css"))) as browser:
        browser.send("Emulation.setEmulatedMedia", media="print")
        for one in (".bars i", ".swatch", ".heat td"):
            assert browser.run(f"getComputedStyle(document.querySelector('{one}')).printColorAdjust") == "exact"


VISIBLE = """(() => {
    const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), shown = [];
    while (walk.nextNode()) {
        const of = walk.currentNode.parentElement;
        if (of.closest("svg, script, style, canvas") || !of.checkVisibility({visibilityProperty: true})) continue;
        if (of.closest("details:not([open])") && !of.closest("summary")) continue;
        shown.push(...walk.currentNode.textContent.split(/\\s+/).filter((word) => /[\\p{L}\\p{N}]/u.test(word)));
    }
    return shown.length;
})()"""
"""Words and numbers that are seen before anything is unfolded, but for those in figures."""
WIDER = """[...document.querySelectorAll("main table")].filter((one) =>
    one.checkVisibility() && !one.closest(".wide") &&
    one.getBoundingClientRect().right > document.querySelector("main").getBoundingClientRect().right + 1).length"""
"""Tables beyond the column that no frame of theirs scrolls."""


def test_five_walks_are_900_words_and_six_printed_pages_and_no_table_leaves_the_column(data, tmp_path):
    assert run(["report", str(data / "c3d_parser_Sydney"), "--out", str(tmp_path / "out")]) in (DONE, NEEDS_A_PERSON)
    with Page((tmp_path / "out" / "report.html").as_uri(), size="1280,900") as browser:
        assert 300 < browser.run(VISIBLE) <= 900
        pdf = base64.b64decode(browser.send("Page.printToPDF", preferCSSPageSize=True)["data"])
        assert 1 <= pdf.count(b"/Type /Page\n") <= 6
        browser.run("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
        assert browser.run(WIDER) == 0


def test_nine_cards_fit_a_printed_page(tmp_path):
    template = template_text("cues.html.j2")
    style = template.split("<style>")[1].split("</style>")[0]
    card = """<li><h2>14. Bow, leg out to the side, both elbows out, forearms forward (round a barrel)</h2>
        <p class="feet">with both feet side by side, the weight on the right one</p><svg viewBox="0 0 200 100"></svg>
        <ul><li class="said">lean the trunk forward by about 30 degrees</li><li class="said">bend the right knee only by
        about 15 degrees</li><li class="said">hold the left foot level sideways</li></ul></li>"""
    with Page(written(tmp_path, f"<ol>{18 * card}</ol>", style)) as browser:
        pdf = base64.b64decode(browser.send("Page.printToPDF", preferCSSPageSize=True)["data"])
    assert pdf.count(b"/Type /Page\n") == 2
