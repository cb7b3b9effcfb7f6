"""What a person should know of a robot's recording and of what its links weigh, in sentences."""

import numpy as np

from biodance.diagnosis.robot import RobotCause, RobotFinding
from biodance.display import cause_in_words
from biodance.effects.plate_crosstalk import PlateCrosstalk
from biodance.effects.plate_gain import PlateGain
from biodance.effects.time_delay import TimeDelay
from biodance.identification.identification import Identification
from biodance.identification.knowledge import SIGMAS
from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.robot_trials import ODD, MatchedTrial
from biodance.records.attention import Attention

_MISWEIGHED = 0.02
"""Of its weight: by so much the identified robot may differ from what the plate carries."""
_APART = 1.0
"""s: clocks further apart are said first."""


def of_file(notes: tuple[str, ...]) -> list[Attention]:
    """Return what was made of the robot's file."""
    return [Attention("warn" if note.startswith("Mended") else "note", note, "", "drawing") for note in notes]


def refusals(refused: dict[str, str]) -> list[Attention]:
    """Return why trials were left out."""
    return [Attention("warn", why, name, "trial") for name, why in refused.items()]


def attention_of(trials: list[MatchedTrial]) -> list[Attention]:
    """Return what a person should know of the recordings: clocks, plates, encoders, what contradicts the drawing."""
    out = []
    for one in trials:
        name, late = one.recorded.name, one.plate.delay
        clocks = (
            f"What the encoders show at t the plate shows at t {late:+.3f} s; brought together by the motion "
            f"(correlation {one.plate.correlation:.3f})."
        )
        out.append(Attention("warn" if abs(late) > _APART else "note", clocks, name, TimeDelay.name))
        if one.innovation > ODD:
            words = (
                f"The plate differs from the drawing by {one.innovation:.1f} times what its masses may be off by: look "
                f"for a load, an encoder with another zero or sign, or hands on the robot."
            )
            out.append(Attention("warn", words, name, "drawing"))
        out += [Attention("warn", text, name, "plate") for text in one.recorded.warnings]
        out += [Attention("note", text, name, "encoders") for text in one.recorded.encoders.notes]
    return out


def cause_words(causes: tuple[RobotFinding, ...], *, doubtful: bool = False) -> list[Attention]:
    """Return what is not as drawn; ``doubtful`` where the motion kept is not predicted better without the causes."""
    if doubtful:
        names = ", ".join(_named(one.cause) for one in causes)
        text = (
            f"Something is not as drawn that resembles {names}; without it the motion kept is not predicted better, so "
            f"nothing is named and nothing was taken out."
        )
        return [Attention("warn", text, "", "drawing")]
    out = []
    for one in causes:
        others = " or ".join(_named(rival) for rival in one.rivals[:3])
        more = f" The recording does not tell it from: {others}." if others else ""
        text = f"{_finding_sentence(one)} It was taken out before the masses were identified.{more}"
        out.append(Attention("warn", text, "", one.cause.kind))
    return out


def _named(cause: RobotCause) -> str:
    return f"{cause_in_words(cause.kind)} of {cause.where}"


def _finding_sentence(one: RobotFinding) -> str:
    """Return a finding as a sentence, with its 95 % interval."""
    where, value, reach = one.cause.where, one.value, SIGMAS * one.sd
    angle = f"{np.degrees(value):.2f} ± {np.degrees(reach):.2f} degrees"
    several = len(one.cause.joints) > 1
    verb, its = ("give", "their encoders") if several else ("gives", "its encoder")
    match one.cause.kind:
        case "encoder_zero":
            return f"The encoder of {where} reads {angle} too much: its zero is not the drawing's."
        case "flexible_joint":
            return f"{where} {verb} under load behind {its}: {angle} per N·m."
        case "soft_sole":
            return f"Ground or sole give {where} under a standing foot: {angle} per N·m."
        case "backlash":
            return f"{where} {'have' if several else 'has'} play: {angle} between the two sides."
        case PlateGain.name:
            too = "large" if value > 0 else "small"
            return f"The plate reads {where} {100 * abs(value):.1f} ± {100 * reach:.1f} % too {too}."
        case PlateCrosstalk.name:
            return f"The plate's crosstalk from {where} is {100 * value:.1f} ± {100 * reach:.1f} %."
        case _:
            return f"The {_named(one.cause)} is {value:.3g} ± {reach:.2g} {one.cause.unit}."


def misweighed(found: SessionIdentification) -> list[Attention]:
    """Return where the plate carries another weight than the identified robot has."""
    out = []
    for one in found.validations or found.fitted:
        seen, needed = (float(np.mean(wrench.value[one.use, 2])) for wrench in (one.measured, one.identified))
        if abs(seen - needed) > _MISWEIGHED * needed:
            text = (
                f"The plate carries {seen:.1f} N, the robot that moments and weight together tell weighs {needed:.1f} "
                f"N: look at the plate's zero and its gain of Fz; the recording does not tell which."
            )
            out.append(Attention("warn", text, one.name, "plate"))
    return out


def weights(done: Identification) -> list[Attention]:
    """Return what weighs more or less than drawn, beyond doubt."""
    if done.status == "failed":
        return [Attention("fail", done.cause, "", "identification")]
    total = np.zeros(done.sip.phi.size)
    total[::10] = 1.0
    drawn, mass = float(done.body.sip.mass.sum()), float(done.sip.mass.sum())
    reach = SIGMAS * float(np.sqrt(total @ done.sip.covariance @ total))
    out = []
    if abs(mass - drawn) > reach:
        out.append(
            f"The robot weighs {mass:.2f} ± {reach:.2f} kg, {abs(mass - drawn):.2f} kg "
            f"{'less' if mass < drawn else 'more'} than drawn ({drawn:.2f} kg)."
        )
    for known in done.known:
        reach = SIGMAS * known.sd
        if known.quantity == "mass" and known.verdict != "cannot be known" and abs(known.value - known.table) > reach:
            change = known.value - known.table
            out.append(
                f"{known.segment} is {abs(change):.3f} ± {reach:.3f} kg {'lighter' if change < 0 else 'heavier'} than "
                f"drawn: covers or cables {'off' if change < 0 else 'on'}?"
            )
    return [Attention("note", text, "", "mass") for text in out]
