"""Who moves in this session: the body scaled on a static trial, else from stature alone; how it came about is said."""

import math
from functools import partial

from biodance.body.body import Body
from biodance.body.human import DEFAULT_TABLE, human
from biodance.body.scaling import scale
from biodance.errors import SessionRefused
from biodance.pipeline.results import Step
from biodance.pipeline.steps import attempt
from biodance.pipeline.trial import Prepared
from biodance.records import Subject


def body_of(subject: Subject, read: tuple[Prepared, ...], steps: list[Step]) -> tuple[Body | None, str]:
    """Return the body of the session and one sentence on where it comes from; None without mass, stature or markers, with the step refused.

    Every static trial is tried in turn; where none can be used, lengths come from stature and markers from their usual places.
    """
    if attempt(steps, "subject", lambda: _known(subject)) is None:
        return None, "No body: the subject's mass or stature is not known."
    statics = [one.trial for one in read if one.trial.role == "static" and one.usable]
    for static in statics:
        body = attempt(steps, "scale", partial(scale, subject, static))
        if body is not None:
            return body, f"Scaled on the static trial {static.name}; masses and inertias from the table {DEFAULT_TABLE}."
    if not statics:
        steps.append(Step("scale", "refused", "No static trial can be used, so the body comes from stature alone. Record a static trial."))
    sets = [one.trial.marker_set for one in read if one.trial.marker_set]
    if not sets:
        return None, "No body: no trial has markers of a known set."
    body = attempt(steps, "body from stature", lambda: human(subject, markers=sets[0]))
    return body, f"From stature alone, with the usual places of the markers; masses and inertias from the table {DEFAULT_TABLE}."


def _known(subject: Subject) -> Subject:
    """Return the subject.

    Raises
    ------
    SessionRefused
        The body mass or the stature is not known.
    """
    missing = [name for name, value in (("mass_kg", subject.mass), ("height_m", subject.stature)) if not math.isfinite(value)]
    if missing:
        raise SessionRefused(
            f"The subject's {' and '.join(missing)} are not known, so there is no body. Set them in session.toml, [subject]."
        )
    return subject
