"""Plates over an archive: what changed is found at its date, what did not is left alone, a forgotten pad is named."""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from two_plates import session

from benchmarks.plates import Step, draw
from biodance.cli import run
from biodance.diagnosis.archive.conditions import pool
from biodance.diagnosis.archive.evidence import plate_evidence
from biodance.diagnosis.archive.judge import judge_archive
from biodance.diagnosis.archive.quantities import PlateEvidence, PlateVisit
from biodance.diagnosis.archive.walking import StepRow, plate_places
from biodance.errors import FileRefused, SessionRefused
from biodance.lab.session.archive import archive_folders, iso_date, read_index, read_plate_text, visit_date
from biodance.pipeline.learn import PlatesJudged, judge_plates
from biodance.report.laboratory import QUANTITY_TITLES, plate_figure, plates_document, plates_page

WEIGHT = 600.0


def altered(every, by):
    """Return evidence with ``by(one)`` added to each value."""
    return [replace(one, value=one.value + by(one)) for one in every]


def changes(found):
    return {(one.plate, one.quantity): one for card in found.plates for one in card.changes}


@pytest.mark.parametrize(
    ("step", "visits"),
    [(Step("plate2", "place_y", 0.005, 8), 13), (Step("plate1", "offset_z", 5.0, 8), 10)],
)
def test_a_step_is_found_soon_with_its_date_and_size(step, visits):
    found = changes(judge_archive(draw(5, visits=visits, step=step)))
    change = found[step.plate, step.quantity]
    assert change.earliest.name <= "V08" <= change.latest.name
    assert change.interval[0] < step.size < change.interval[1]
    assert set(found) == {(step.plate, step.quantity)}


def test_a_step_of_all_plates_is_that_of_the_laboratory():
    moved = altered(draw(2), lambda one: 0.02 * (one.quantity == "place_x" and one.visit.name >= "V08"))
    assert ("all plates", "place_x") in changes(judge_archive(moved))


def test_an_archive_without_fault_raises_no_alarm():
    assert sum(bool(judge_archive(draw(seed)).findings) for seed in range(20, 24)) == 0


def test_one_strange_visit_is_no_change_of_the_plate():
    odd = altered(draw(4), lambda one: 12.0 * (one.quantity == "offset_z" and one.visit.name == "V09"))
    found = judge_archive(odd)
    assert not changes(found)
    assert {one.visit for one in found.strangers if one.quantity == "offset_z"} == {"V09"}


def test_a_visit_that_differs_by_nothing_that_matters_is_not_told():
    """Plates whose zero was taken off agree so well that a hundredth of a newton is sure, and means nothing."""
    quiet = [
        replace(one, value=1e-4 * one.value + 0.01 * (one.visit.name == "V09"), sd=1e-4 * one.sd)
        for one in draw(4)
        if one.quantity == "offset_z"
    ]
    found = judge_archive(quiet)
    assert any(one.visit == "V09" for some in found.histories for one in some.strangers)
    assert found.strangers == ()


def test_whoever_stands_for_long_shows_a_zero_better():
    """The mean force is m (v1 - v0) / T: 62 kg that sway at 0.02 m/s, both at the beginning and the end of T."""
    static = session()["static"]
    found = [one for one in plate_evidence([static], PlateVisit("V01", "S01")) if one.quantity == "offset_x"]
    seconds = float(np.ptp(static.plates[0].wrench.time))
    assert [len(one.plates) for one in found] == [2]
    assert found[0].sd == pytest.approx(np.hypot(0.3, 2**0.5 * 62.0 * 0.02 / seconds), rel=0.01)
    assert abs(found[0].value) < found[0].sd


def test_pooled_mean_of_values_computed_by_hand():
    equal = pool(np.array([1.0, 2.0, 3.0]), np.array([1.0, 1.0, 1.0]))
    assert (equal.mean, equal.spread) == (pytest.approx(2.0), 0.0)
    assert equal.sd == pytest.approx(1 / np.sqrt(3))
    apart = pool(np.array([0.0, 10.0]), np.array([1e-3, 1e-3]))
    assert apart.spread == pytest.approx(np.sqrt(50.0), rel=1e-3)
    np.testing.assert_allclose(apart.own, [0.0, 10.0], atol=1e-3)


def test_steps_of_both_feet_tell_the_plate_from_the_foot():
    """Feet that press 4 mm outwards on a plate 6 mm to the left: right steps read 2 mm to the right of it."""
    part = {"person feet": 0.004}
    rows = [StepRow("plate1", np.array([0.0, y]), 0.004 + 0.006 * y, 0.003, part) for y in (1.0, -1.0) * 20]
    place, sd = plate_places(rows)["plate1"]
    assert place[1] == pytest.approx(0.006, abs=2e-4)
    assert sd[1] < 0.001
    assert sd[0] > 0.1


def recording(path: Path, force: tuple[float, float, float]) -> None:
    chance = np.random.default_rng(len(path.name))
    rows = ["Time[s]\tFx[N]\tFy[N]\tFz[N]\tMx[Nm]\tMy[Nm]\tMz[Nm]"]
    for i in range(300):
        noise = chance.normal(0, 0.3, 3)
        values = [0.01 * i, *(np.array(force) + noise), 1.0, 2.0, 0.1]
        rows.append("\t".join(f"{x:.4f}" for x in values))
    path.write_text("\n".join(rows) + "\n")


@pytest.fixture(scope="module")
def balance(tmp_path_factory):
    """Return an archive of four persons on one plate: a pad of 8 N lies in half of the trials, zeros wander along x."""
    folder = tmp_path_factory.mktemp("balance")
    rows, wanders = [["trial", "subject", "surface", "age", "mass_kg", "date"]], (5.0, -4.0, 8.0, -7.0)
    for person, along in enumerate(wanders):
        for trial in range(4):
            foam = trial % 2 == 1
            name = f"p{person}t{trial}"
            pad = 8.0 + 0.3 * person if foam else 0.0
            recording(folder / f"{name}.txt", (along, 0.2 * trial, WEIGHT + 20 * person + pad))
            mass = (WEIGHT + 20 * person) / 9.80665 + 0.05 * (-1) ** person
            kind, day = "foam" if foam else "firm", f"2024-03-{5 + person:02d}"
            rows.append([name, f"S{person}", kind, "30", f"{mass:.4f}", day])
    rows.append(["missing", "S9", "firm", "30", "60", "2024-03-09"])
    with open(folder / "trials.csv", "w", newline="") as stream:
        csv.writer(stream).writerows(rows)
    return folder


def test_a_pad_that_was_not_zeroed_is_named_in_everybody(balance, tmp_path, capsys):
    assert run(["plates", str(balance), "--out", str(tmp_path / "out"), "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    (card,) = document["plates"]
    pad = next(one for one in card["findings"] if "surface foam" in one["text"])
    assert (pad["effect"], pad["target"]) == ("plate_offset", "Fz")
    assert pad["ci95"][0] < 8.45 < pad["ci95"][1]
    assert document["common"][0]["persons_named"] == ["S0", "S1", "S2", "S3"]
    assert all(any("foam" in one["text"] for one in person["findings"]) for person in document["persons"])
    assert any("wanders" in one["text"] and one["target"] == "Fx" for one in card["findings"])
    assert not any(one["target"] == "Fy" for one in card["findings"])
    rows = list(csv.DictReader((tmp_path / "out" / "plates.csv").read_text().splitlines()))
    assert [row["date"] for row in rows] == ["2024-03-05", "2024-03-06", "2024-03-07", "2024-03-08"]
    assert float(rows[0]["offset_x_n"]) == pytest.approx(5.0, abs=0.2)
    page = (tmp_path / "out" / "report.html").read_text()
    assert "was not zeroed" in page
    assert 'counter(page) " of "' in page
    assert not re.search(r"[+−]0\.0+ N<", page)
    assert run(["plates", str(balance), "--out", str(tmp_path / "out")]) == 2


def test_plates_are_drawn_in_two_columns_without_what_never_differs():
    histories = judge_archive(draw(20)).histories
    zero = next(one for one in histories if one.series.quantity == "offset_z")
    zero = replace(zero, series=replace(zero.series, value=0.0 * zero.series.value))
    others = [one for one in histories if one.series.quantity in ("place_x", "place_y", "delay")]
    drawn = plate_figure("plate1", (*others, zero))
    titles = {axes.get_ylabel().partition("\n")[0] for axes in drawn.axes}
    assert titles == {QUANTITY_TITLES[one.series.quantity] for one in others}
    assert len(titles) == 3
    assert len({axes.get_subplotspec().colspan.start for axes in drawn.axes}) == 2
    assert len(plate_figure("plate1", (zero,)).axes) == 1


def test_the_index_knows_conditions_and_leaves_out_what_is_not_there(balance):
    rows = read_index(balance / "trials.csv")
    assert len(rows) == 16
    assert rows[1].conditions == {"surface": "foam"}
    assert rows[0].mass == pytest.approx(WEIGHT / 9.80665 + 0.05, abs=1e-3)


def test_one_visit_judges_no_plate_and_says_so():
    """A gain of -22 % of a plate that one visit saw (FMC) may be its foot; "nothing wrong" would be false, too."""
    judged = judge_archive([one for one in draw(4) if one.visit.name == "V01"])
    assert not judged.findings
    found = PlatesJudged(Path("lab"), judged, (), {})
    document = plates_document(found)
    (note,) = document["notes"]
    assert note.endswith("not judged, as one visit cannot tell a plate's fault from a person's. Report the session.")
    page = plates_page(found, document)
    assert "The plates of lab: none can be judged yet" in page
    assert "1 visit of" in page
    assert "Nothing wrong" not in page


def test_text_without_channels_or_with_a_strange_unit_is_refused(tmp_path):
    bare = tmp_path / "a.txt"
    bare.write_text("1\t2\t3\t4\t5\t6\t7\n")
    with pytest.raises(FileRefused, match="does not name time, Fx"):
        read_plate_text(bare)
    bare.write_text("t[s] Fx[furlong] Fy[N] Fz[N] Mx[Nm] My[Nm] Mz[Nm]\n0 1 2 3 4 5 6\n")
    with pytest.raises(FileRefused, match="unit 'furlong' of Fx is not known"):
        read_plate_text(bare)


def test_one_bad_session_stops_nothing(balance, tmp_path):
    archive = tmp_path / "lab"
    (archive / "broken").mkdir(parents=True)
    (archive / "broken" / "walk.c3d").write_bytes(b"no c3d at all" * 100)
    (archive / "balance").symlink_to(balance, target_is_directory=True)
    found = judge_plates(archive)
    assert "broken" in next(iter(found.refused))
    assert len(found.judgement.visits) == 4


def test_archives_without_sessions_are_refused(tmp_path):
    with pytest.raises(SessionRefused, match="holds no session"):
        archive_folders(tmp_path)
    with pytest.raises(SessionRefused, match="is no folder"):
        archive_folders(tmp_path / "nowhere")


def test_dates_are_read_and_never_guessed(tmp_path):
    assert iso_date("2015-10-08 08:30:00.000") == "2015-10-08 08:30"
    assert iso_date("3/4/2020") == ""
    visit = tmp_path / "S12_20240305"
    visit.mkdir()
    assert visit_date(visit) == "2024-03-05"
    (visit / "session.toml").write_text("[session]\ndate = 2024-03-07\n")
    assert visit_date(visit) == "2024-03-07"


def test_evidence_without_a_quantity_or_an_error_is_refused():
    visit = PlateVisit("V", "P")
    with pytest.raises(ValueError, match="must be positive"):
        PlateEvidence("gain", {"plate1": 1.0}, 0.0, 0.0, visit, "t")
    with pytest.raises(ValueError, match="not a quantity of a plate"):
        PlateEvidence("gian", {"plate1": 1.0}, 0.0, 1.0, visit, "t")


def part_of_run(data: Path, to: Path, first: float, last: float) -> None:
    """Copy a part of a real run on a split belt, from ``first`` to ``last`` s, as a session of its own."""
    source = data / "opensim_models/raj_run"
    to.mkdir(parents=True)
    (to / "static.trc").write_text((source / "static.trc").read_text())
    for name, head, column in (("run.trc", 5, 1), ("run.mot", 6, 0)):
        rows = (source / name).read_text().splitlines()
        kept = [
            row for row in rows[head:] if row.count("\t") > column and first <= float(row.split("\t")[column]) <= last
        ]
        (to / name).write_text("\n".join([*rows[:head], *kept]) + "\n")


def test_a_split_belt_is_two_plates_in_every_visit(data, tmp_path):
    """Rectangles round the pressures of a run differ from second to second; the columns of its table do not."""
    for k in range(3):
        part_of_run(data, tmp_path / f"visit_{k}", 0.3 + 1.5 * k, 2.0 + 1.5 * k)
    judged = judge_plates(tmp_path)
    assert {card.plate for card in judged.judgement.plates} == {"R_ground_force", "L_ground_force"}
    assert {one.visit.name for one in judged.observations} == {"visit_0", "visit_1", "visit_2"}
    assert not any(one.quantity.startswith("place") for one in judged.observations)
