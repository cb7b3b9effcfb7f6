"""What a movement will be able to see, before any force is measured."""

from html import escape
from io import StringIO

import numpy as np
from diagnosed_sessions import body, known, motion
from rich.console import Console
from small_dances import small_dance

from biodance.dance.expectation import expect
from biodance.effects import effects
from biodance.inference.foresight import foresee, planned, session_of
from biodance.report.pages.diagnosis import foresight_page
from biodance.report.tables.diagnosis import FIRST, foresight_document, seen_causes
from biodance.report.terminal import print_foresight

CHOSEN = ("plate_gain", "plate_offset", "body_mass", "time_delay", "added_mass")


def test_a_planned_movement_says_what_it_will_see() -> None:
    moves = tuple(motion(s) for s in (1, 2, 3))
    found = foresee(body(), moves, tolerances=known(), effects=CHOSEN)
    limit = {(row.effect, row.target): row.limit for row in found.limits}
    assert 0 < limit["plate_gain", "Fz"] < 0.05
    assert limit["added_mass", "left_forearm_hand"] < limit["added_mass", "pelvis"]
    assert found.confusions[0].difference == found.separation
    assert {"body_mass", "added_mass"} >= {found.confusions[0].cause[0]} | {found.confusions[0].other[0]}
    more = foresee(body(), (*moves, *(motion(s) for s in (4, 5, 6))), tolerances=known(), effects=CHOSEN)
    later = {(row.effect, row.target): row.limit for row in more.limits}
    assert later["plate_gain", "Fz"] < limit["plate_gain", "Fz"]


def test_standing_still_sees_no_delay() -> None:
    still = motion(1)
    frozen = type(still)(still.time, np.tile(still.q[0], (still.time.size, 1)), 0 * still.v, 0 * still.a)
    found = foresee(body(), (frozen,), tolerances=known(), effects=("plate_gain", "plate_offset"))
    assert {row.effect for row in found.hidden} >= {"plate_gain"}


def test_a_planned_trial_has_the_tables_wrench_and_markers_without_residual() -> None:
    trial = planned(body(), motion(1), "p")
    assert trial.markers is not None
    assert np.abs(trial.plates[0].centre[:2] - np.nanmean(trial.wrench.cop()[:, :2], axis=0)).max() < 1e-9


def test_a_long_movement_is_cut_into_trials() -> None:
    pieces = session_of(motion(1), 4.0)
    assert len(pieces) == 3
    assert sum(one.time.size for one in pieces) == motion(1).time.size


def test_what_to_change_is_in_the_words_of_the_causes_that_stay_unseen() -> None:
    still = motion(1)
    frozen = type(still)(still.time, np.tile(still.q[0], (still.time.size, 1)), 0 * still.v, 0 * still.a)
    found = foresee(body(), (frozen,), tolerances=known(), effects=("plate_gain", "plate_offset"))
    page = foresight_page(foresight_document(found, plates="The feet need room."), "standing")
    assert "The feet need room." in page
    (squats, *_) = [one for one in found.changes if one.do == effects()["plate_gain"].separated_by]
    assert {name for name, _ in squats.unseen} == {"plate_gain"}
    assert escape(squats.do, quote=True).replace("&#x27;", "&#39;") in page
    assert f"{len(found.seen)} at their typical size" in page
    assert "plate gain (" in page


def test_what_a_dance_teaches_and_does_not_leads_and_the_rest_is_folded() -> None:
    found, dance = foresee(body(), (motion(1),), tolerances=known(), effects=CHOSEN), small_dance()
    document = foresight_document(found, known=expect(dance, steps=1))
    assert document["learned"].startswith("Masses that it teaches (by the table alone): ")
    assert "left upper arm ±" in document["learned"], "the arm that is lifted"
    assert "right upper arm ±" not in document["learned"], "the arm that hangs"
    assert "right forearm with hand ±" not in document["learned"]
    assert len(seen_causes(document)) == len(found.seen) > 0
    page = foresight_page(document, "the dance")
    order = ["What it can tell", "What it cannot tell", "What to change", "<details>", "What looks alike"]
    places = [page.index(text) for text in order]
    assert places == sorted(places)
    console = Console(width=200, record=True, file=StringIO())
    print_foresight(document, console)
    told = console.export_text()
    assert told.count("to change:") == min(FIRST, len(found.changes))
    assert document["learned"] in told
    assert len(told.splitlines()) < 20
