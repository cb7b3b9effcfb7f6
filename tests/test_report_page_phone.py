"""The report page on a phone: nothing is wider than the screen, and no table has to be pushed aside to be read."""

import pytest
from browser import BROWSER, Page
from example_results import full_session, html_of
from identified_sessions import session_result

from biodance.batch.summary import write_summary
from biodance.batch.work import Outcome

_WIDER = """[...document.querySelectorAll('html, .wide, .wide *')].filter(one => one.clientWidth > 0
  && one.scrollWidth > one.clientWidth + 1).map(one => one.tagName + ' ' + one.innerText.slice(0, 60))"""


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
@pytest.mark.parametrize("which", ["checks", "identified"])
def test_no_table_is_wider_than_a_phone(which, tmp_path):
    page = tmp_path / "page.html"
    page.write_text(html_of(full_session() if which == "checks" else session_result()), encoding="utf-8")
    with Page(page.as_uri()) as browser:
        browser.send("Emulation.setDeviceMetricsOverride", width=390, height=844, deviceScaleFactor=1, mobile=True)
        assert browser.run("document.querySelectorAll('table').length") > 3
        browser.run("document.querySelectorAll('details').forEach(one => one.open = true)")
        assert browser.run("document.documentElement.clientWidth") == 390
        assert browser.run(_WIDER) == []


def test_a_session_without_a_kept_trial_says_that_it_predicts_nothing():
    said = "No trial was kept to ask this of"
    assert said in html_of(session_result(roles=("fit",)))
    assert said not in html_of(session_result())


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
def test_the_long_paths_of_an_archive_are_folded_on_a_phone(tmp_path):
    path = "/" + "/".join(["a_folder_with_a_long_name"] * 4) + "/walk.c3d: is empty (0 bytes)."
    write_summary(tmp_path, "archive", [Outcome("a_session_with_a_rather_long_name" * 2, "0", "refused", path)])
    with Page((tmp_path / "report.html").as_uri()) as browser:
        browser.send("Emulation.setDeviceMetricsOverride", width=390, height=844, deviceScaleFactor=1, mobile=True)
        assert browser.run("document.querySelectorAll('table').length") == 2
        assert browser.run("document.documentElement.scrollWidth") == 390
