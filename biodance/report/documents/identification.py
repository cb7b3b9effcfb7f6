"""What identification found, under keys whose unit is their suffix; channels in the order Fx Fy Fz Mx My Mz."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from biodance.identification.added_mass import LoadSearch
from biodance.identification.identification import Identification
from biodance.identification.knowledge import SIGMAS, Known, known_together
from biodance.identification.load_words import say_load
from biodance.identification.torques import TorqueBands
from biodance.identification.validation import ResidualRatio, TrialValidation
from biodance.motion.regressor import Agreement
from biodance.pipeline.identification import SessionIdentification
from biodance.report.documents.plain import keyed

if TYPE_CHECKING:
    from biodance.dance.scoring import PerformanceScore

_TENSOR = ("xx", "xy", "yy", "xz", "yz", "zz")
ASKED = ("mass", "com x", "com y", "com z")
"""Quantities whose shares from the data are averaged into a segment's ``information``."""


def agreement(found: Agreement) -> dict[str, Any]:
    """Return RMS and correlation of six channels; null where a correlation is not defined."""
    return keyed(found, "rms cc=correlation frames")


def segment_rows(found: Identification, name: str) -> tuple[Known, ...]:
    """Return the ten quantities of one segment in order."""
    return tuple(known for known in found.known if known.segment == name)


def information_share(rows: Sequence[Known]) -> float:
    """Return the share of a segment's mass and centre of mass that comes from the data, 0 to 1."""
    return float(np.mean([row.from_data for row in rows if row.quantity in ASKED]))


def prior_source(found: Identification, name: str) -> str:
    """Return where the prior mass of a segment comes from: "table", "table and girths (knee) and scan"."""
    said = found.body.girths.get(name, ())
    shapes = [word for word in said if word in ("foot outline", "scan")]
    girths = ", ".join(word for word in said if word not in shapes).replace("_", " ")
    return " and ".join(["table", *([f"girths ({girths})"] if girths else []), *shapes])


def _segment(found: Identification, name: str) -> dict[str, Any]:
    rows = segment_rows(found, name)
    mass, com, inertia = rows[0], rows[1:4], rows[4:]
    return {
        "name": name,
        **keyed(mass, "mass_kg=value mass_sd_kg=sd mass_prior_kg=table mass_prior_sd_kg=table_sd"),
        "mass_prior_source": prior_source(found, name),
        "com_m": [row.value for row in com],
        "com_sd_m": [row.sd for row in com],
        "com_prior_m": [row.table for row in com],
        "inertia_kgm2": [row.value for row in inertia],
        "inertia_sd_kgm2": [row.sd for row in inertia],
        "inertia_prior_kgm2": [row.table for row in inertia],
        "information": information_share(rows),
        "from_data": {row.quantity: row.from_data for row in rows},
        "verdict": {row.quantity: row.verdict for row in rows},
    }


def _validation(trial: TrialValidation) -> dict[str, Any]:
    return {
        "trial": trial.name,
        "about_m": trial.about,
        "table": agreement(trial.table_agreement),
        "identified": agreement(trial.identified_agreement),
    }


def _gain(found: ResidualRatio | None) -> dict[str, Any] | None:
    keys = "force force_ci95=force_interval moment moment_ci95=moment_interval"
    return keyed(found, keys) if found else None


def added_mass_document(search: LoadSearch) -> dict[str, Any] | None:
    """Return the load that is announced, its place in the segment's joint frame; None where none is."""
    if not search.found:
        return None
    best = search.best
    return {
        "status": search.status,
        "text": say_load(search),
        **keyed(best, "segment kg=mass sd_kg=sd ci95_kg=interval place_m=place place_sd_m=place_sd"),
        "p_none": search.p_no_load,
        "smallest_detectable_kg": best.smallest,
        "reference": search.reference,
        "probability": best.probability,
        "set": search.segments,
        "place_on": search.lies_on or best.segment,
        "place_frame": "segment: from its proximal joint centre, x forward, y up, z right",
    }


_SUSPECT = "segment kg=mass sd_kg=sd ci95_kg=interval probability log_bayes_factor smallest_detectable_kg=smallest"


def _search(search: LoadSearch) -> dict[str, Any]:
    return {
        "status": search.status,
        "text": say_load(search),
        **keyed(search, "doubts reference p_none=p_no_load announced=found"),
        "segments": [keyed(suspect, _SUSPECT) for suspect in search.suspects],
    }


def _together(one: Identification) -> list[dict[str, Any]]:
    return [
        keyed(several, "segments mass_kg=mass mass_sd_kg=sd")
        | {"mass_ci95_kg": (several.mass - SIGMAS * several.sd, several.mass + SIGMAS * several.sd)}
        for several in (known_together(one.sip) if one.status == "solved" else ())
    ]


_DIFFERENCE = "segment quantity unit later_minus_earlier=value sd ci95=interval p known"
_REPETITION = "transition start_s=start end_s=end gain most"


def torques_document(bands: TorqueBands | None) -> dict[str, Any] | None:
    """Return every joint's largest torque with its interval, over the fully measured frames; None where the feet's
    wrenches are unknown.
    """
    if bands is None:
        return None
    rows = []
    for j, name in enumerate(bands.joints):
        torque, half, table = (column[bands.use, j] for column in (bands.torque, bands.half_width, bands.table))
        peak = int(np.argmax(np.abs(torque)))
        rows.append(
            {
                "joint": name,
                "peak_time_s": bands.time[bands.use][peak],
                "peak_Nm": torque[peak],
                "peak_ci95_Nm": (torque[peak] - half[peak], torque[peak] + half[peak]),
                "peak_table_Nm": table[peak],
                "sd_rms_Nm": np.sqrt(np.mean(bands.sd[bands.use, j] ** 2)),
                "change_rms_Nm": np.sqrt(np.mean((torque - table) ** 2)),
            }
        )
    return {"trial": bands.trial, "joints": rows}


def performance_document(found: "PerformanceScore | None") -> dict[str, Any] | None:
    """Return how well a dance was danced: share of the table's variance removed, planned and reached; ``repeat`` the
    transitions to dance once more, by number (n leads from cue n to the next); None where no dance was named.
    """
    if found is None:
        return None
    return {
        **keyed(found, "dance seconds"),
        "excitation": [vars(one) for one in found.excitation],
        "repeat": found.repeat,
        "repetitions": [keyed(one, _REPETITION) for one in found.repetitions],
    }


def identification_document(found: SessionIdentification) -> dict[str, Any]:
    """Return all that identification found.

    CoM in the segment's axes from its proximal joint centre; inertia about the CoM, order xx xy yy xz yz zz; validation
    moments about ``about_m``, the mean centre of pressure. ``added_mass`` null: no load is announced;
    ``known_together`` the masses of neighbours that are more certain than their own, surest first;
    ``added_mass_search`` says what was looked for and whether one is "found", there is "none" or one "cannot tell";
    ``joint_torques`` of one trial with what the parameters leave uncertain (not this trial's own skin and plates);
    ``impacts`` the ``pull`` of every quantity from its prior and what is ``left`` of its standard deviation, both in
    prior ones, and the RMS moment that one standard deviation of it after the data adds at knee and hip, largest first;
    ``differences`` to the reference session, empty without one; ``performance`` how well the dance that was shown was
    danced, null without one. ``failures`` what could not be computed, with cause and
    cure; after a failed fit (``status``) there are no segments.
    """
    one = found.identification
    return {
        **keyed(one, "status cause"),
        "failures": found.failures,
        **keyed(one, "trials frames"),
        "segments": [_segment(one, name) for name in one.sip.segments] if one.status == "solved" else [],
        "inertia_order": _TENSOR,
        "base_parameters": {
            "count": one.base.base.count,
            "well_known": len(one.base.well_known),
            "rank": one.base.rank,
        },
        "disturbances": keyed(one.sizes, "kinematics noise_variance=noise"),
        "validation": [_validation(trial) for trial in found.validations],
        "fitted": [_validation(trial) for trial in found.fitted],
        "gain": _gain(found.gain),
        "added_mass": added_mass_document(found.search),
        "added_mass_search": _search(found.search),
        "known_together": _together(one),
        "joint_torques": torques_document(found.torques),
        "impacts": [keyed(row, "segment quantity pull left knee_Nm=knee hip_Nm=hip") for row in found.impacts],
        "differences": [keyed(row, _DIFFERENCE) for row in found.changes],
        "performance": performance_document(found.performance),
        "notes": found.notes,
    }
