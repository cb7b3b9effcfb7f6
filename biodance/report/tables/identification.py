"""What identification found. Channels in the order Fx Fy Fz Mx My Mz."""

import numpy as np

from biodance.display import spaced
from biodance.identification.added_mass import LoadSearch
from biodance.identification.identification import Identification
from biodance.identification.knowledge import SIGMAS, Known, known_together
from biodance.identification.torques import TorqueBands
from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.words import say_load
from biodance.report.tables.schema import Row, Schema

TENSOR_ORDER = ("xx", "xy", "yy", "xz", "yz", "zz")
ASKED = ("mass", "com x", "com y", "com z")
"""Quantities whose shares from the data, 0 to 1, are averaged into a segment's ``information``."""
AGREEMENT_ROW = Schema("rms cc=correlation frames")
"""RMS and correlation of six channels; null where a correlation is not defined."""
VALIDATION_ROW = Schema(
    "trial=name about_m=about",
    {
        "table": AGREEMENT_ROW.at("table_agreement"),
        "identified": AGREEMENT_ROW.at("identified_agreement"),
        "extended": AGREEMENT_ROW.at("extended_agreement"),
        "gain": Schema("", {name: Schema("value ci95") for name in ("mass", "distribution", "tissue")}),
    },
)


CORRECTED_ROW = Schema("effect target trials value=parameters.0.value sd=parameters.0.sd unit=parameters.0.unit")
"""What was taken off before the fit, in the unit of its cause, null where it has no size; () = all trials. Of a turned
sign: where in the lab its moments are about, if not about the plate's centre.
"""


def segment_rows(found: Identification, name: str) -> tuple[Known, ...]:
    """Return the ten quantities of one segment in order."""
    return tuple(known for known in found.known if known.segment == name)


def _each(attribute: str, first: int, last: int) -> str:
    """Return the places of an attribute in some of a segment's ten quantities."""
    return ",".join(f"{k}.{attribute}" for k in range(first, last + 1))


SEGMENT_ROW = Schema(
    "name=0.segment mass_kg=0.value mass_sd_kg=0.sd mass_prior_kg=0.table mass_prior_sd_kg=0.table_sd "
    f"com_m={_each('value', 1, 3)} com_sd_m={_each('sd', 1, 3)} com_prior_m={_each('table', 1, 3)} "
    f"inertia_kgm2={_each('value', 4, 9)} inertia_sd_kgm2={_each('sd', 4, 9)} "
    f"inertia_prior_kgm2={_each('table', 4, 9)}",
    {
        "mass_prior_source": lambda _: "table",
        "information": lambda rows: float(np.mean([row.from_data for row in rows if row.quantity in ASKED])),
        "from_data": lambda rows: {row.quantity: row.from_data for row in rows},
        "verdict": lambda rows: {row.quantity: row.verdict for row in rows},
    },
    "segment: {name:name} | mass (kg): {mass_kg:2} {mass_sd_kg:±2} | table (kg): {mass_prior_kg:2} "
    "{mass_prior_sd_kg:±2} | x (mm): {com_m[0]:mm0} {com_sd_m[0]:±mm0} | y (mm): {com_m[1]:mm0} {com_sd_m[1]:±mm0} | "
    "z (mm): {com_m[2]:mm0} {com_sd_m[2]:±mm0} | from the data: {information:%0 %}",
)


def segments_document(found: Identification) -> list[Row]:
    """Return a row for each segment; none after a failed fit."""
    if found.status != "solved":
        return []
    rows = []
    for name in found.sip.segments:
        said = found.body.girths.get(name, ())
        shapes = [word for word in said if word in ("foot outline", "scan")]
        girths = spaced(", ".join(word for word in said if word not in shapes))
        # where the prior mass comes from: "table", "table and girths (knee) and scan"
        source = " and ".join(["table", *([f"girths ({girths})"] if girths else []), *shapes])
        rows.append(SEGMENT_ROW.row(segment_rows(found, name)) | {"mass_prior_source": source})
    return rows


_LOAD = Schema(
    "status segment=best.segment kg=best.mass sd_kg=best.sd ci95_kg=best.interval place_m=best.place "
    "place_sd_m=best.place_sd p_none=p_no_load smallest_detectable_kg=best.smallest reference "
    "probability=best.probability set=segments",
    {
        "text": say_load,
        "place_on": lambda search: search.lies_on or search.best.segment,
        "place_frame": lambda _: "segment: from its proximal joint centre, x forward, y up, z right",
    },
)
SUSPECT_ROW = Schema(
    "segment kg=mass sd_kg=sd ci95_kg=interval probability log_bayes_factor smallest_detectable_kg=smallest",
    shown="segment: {segment:name} | probability: {probability:3} | load (kg): {kg:2} {sd_kg:±2} | "
    "smallest that would be found (kg): {smallest_detectable_kg:2}",
)


def added_mass_document(search: LoadSearch) -> Row | None:
    """Return the load that is announced, its place in the segment's joint frame; None where none is."""
    return _LOAD.row(search) if search.found else None


TORQUE_ROW = Schema(
    "joint peak_time_s peak_Nm peak_ci95_Nm peak_table_Nm sd_rms_Nm change_rms_Nm",
    shown="joint: {joint:name} | identified: {peak_Nm:1} | 95 % interval: {peak_ci95_Nm[0]:1} to {peak_ci95_Nm[1]:1} | "
    "table: {peak_table_Nm:1} | RMS change: {change_rms_Nm:1}",
)


def torques_document(bands: TorqueBands | None) -> Row | None:
    """Return every joint's largest torque over measured frames; None where the feet's wrenches are unknown."""
    if bands is None:
        return None
    joints, columns = list[Row](), (bands.torque, bands.half_width, bands.table, bands.sd)
    for j, name in enumerate(bands.joints):
        torque, half, table, sd = (column[bands.use, j] for column in columns)
        # where the identified torque is largest, either way; the table's is that of the same instant
        peak = int(np.argmax(np.abs(torque)))
        interval = (torque[peak] - half[peak], torque[peak] + half[peak])
        sizes = (np.sqrt(np.mean(sd**2)), np.sqrt(np.mean((torque - table) ** 2)))
        values = (name, bands.time[bands.use][peak], torque[peak], interval, table[peak], *sizes)
        joints.append(dict(zip(TORQUE_ROW.places, values, strict=True)))
    return {"trial": bands.trial, "joints": joints}


VISIT_ROW = Schema(
    "file camera same",
    {
        "begun": lambda log: log.begun.isoformat(),
        "postures": Schema("number times held_s skipped easier told_percent reached_deg"),
        "danced": lambda log: sum(one.times > 0 for one in log.postures),
        "skipped": lambda log: log.numbers("skipped"),
        "easier": lambda log: log.numbers("easier"),
        "repeated": lambda log: log.numbers("repeated"),
    },
)
"""One log of a visit; ``same`` False: of another dance than was named."""


def log_in_words(row: Row) -> str:
    """Return a log (`VISIT_ROW`) in a sentence: what was danced, left out, made easier or repeated."""
    if not row["same"]:
        return f"{row['file']} is the log of another dance; give the one that was shown."
    parts = [f"{row['danced']} of {len(row['postures'])} postures danced"]
    parts += [
        f"{what} {', '.join(str(number) for number in row[what])}"
        for what in ("skipped", "easier", "repeated")
        if row[what]
    ]
    return f"{row['file']}: {'; '.join(parts)}."


_PERFORMANCE = Schema(
    "dance seconds repeat",
    {
        "excitation": Schema("segment planned reached"),
        "repetitions": Schema("transition start_s=start end_s=end gain most"),
        "logs": VISIT_ROW,
    },
)
"""How well a dance was danced: share of the table's variance removed, planned and reached; ``repeat`` the transitions
to dance once more, by number (n leads from cue n to the next); ``logs`` what the page that led noted.
"""
DIFFERENCE_ROW = Schema(
    "segment quantity unit later_minus_earlier=value sd ci95=interval p known",
    shown="segment: {segment:name} | difference (kg): {later_minus_earlier:2} | "
    "95 % interval (kg): {ci95[0]:2} to {ci95[1]:2} | p: {p:p}",
)


_IDENTIFICATION = Schema(
    "method status cause=identification.cause failures trials=identification.trials frames=identification.frames",
    {
        "segments": lambda found: segments_document(found.identification),
        "inertia_order": lambda _: TENSOR_ORDER,
        "base_parameters": Schema("count=base.count well_known=#well_known rank").at("identification.base"),
        "disturbances": Schema("kinematics noise_variance=noise").at("identification.sizes"),
        "validation": VALIDATION_ROW.at("validations"),
        "fitted": VALIDATION_ROW,
        "gain": Schema("force force_ci95=force_interval moment moment_ci95=moment_interval"),
        "added_mass": lambda found: added_mass_document(found.search),
        "added_mass_search": Schema(
            "status doubts reference p_none=p_no_load announced=found",
            {"text": say_load, "segments": SUSPECT_ROW.at("suspects")},
        ).at("search"),
        "known_together": lambda found: [
            Schema("segments mass_kg=mass mass_sd_kg=sd").row(several)
            | {"mass_ci95_kg": (several.mass - SIGMAS * several.sd, several.mass + SIGMAS * several.sd)}
            for several in (known_together(found.identification.sip) if found.identification.status == "solved" else ())
        ],
        "joint_torques": lambda found: torques_document(found.torques),
        "impacts": Schema("segment quantity pull left knee_Nm=knee hip_Nm=hip"),
        "differences": DIFFERENCE_ROW.at("changes"),
        "performance": _PERFORMANCE,
        "notes": lambda found: found.notes,
        "posterior": lambda found: identification_document(found.posterior) if found.posterior else None,
    },
)


def identification_document(found: SessionIdentification) -> Row:
    """Return all that identification found.

    CoM in the segment's axes from its proximal joint centre; inertia about the CoM, order xx xy yy xz yz zz; validation
    moments about ``about_m``, the mean centre of pressure. ``added_mass`` null: no load is announced;
    ``known_together`` the masses of neighbours that are more certain than their own, surest first;
    ``added_mass_search`` says what was looked for and whether one is "found", there is "none" or one "cannot tell";
    ``joint_torques`` of one trial with what the parameters leave uncertain (not this trial's own skin and plates);
    ``impacts`` the ``pull`` of every quantity from its prior and what is ``left`` of its standard deviation, both in
    prior ones, and the RMS moment that one standard deviation of it after the data adds at knee and hip, largest first;
    ``differences`` to the reference session, empty without one; ``performance`` how well the dance that was shown was
    danced, null without one. ``method`` "paper": parameters of the paper's programme, without standard deviations, and
    under ``posterior`` the same document of the posterior (else null). ``failures`` what could not be computed, with
    cause and cure; after a failed fit (``status``) there are no segments.
    """
    return _IDENTIFICATION.row(found)
