"""The cards of a dance: a page to print, a picture and the instructions of every posture on a card of its own."""

import numpy as np

from biodance.body.body import Body
from biodance.dance.cues import dance_instructions
from biodance.dance.problem.stance import stance_words
from biodance.pipeline.dance_result import DanceResult, not_safe
from biodance.pipeline.preview import held_postures
from biodance.pipeline.still import silhouettes
from biodance.records import Array
from biodance.report.figures.style import SIDE_COLOURS
from biodance.report.pages.template import render

_VIEWS = (("from the front", (1.0, 0.0)), ("from the right", (0.0, -1.0)))
"""Where the eye is in the horizontal plane, for a person who faces lab x."""
_TALL, _GAP, _LABEL = 150.0, 12.0, 70.0
"""Height of the picture in its own units, what is left between the views, and the room that their words take."""
_MIDDLE = "#8d99a6"


def mannequin_svg(body: Body, q: Array, title: str) -> str:
    """Return the picture of the posture ``q`` (nq,): from the front (the person's right is on the left) and from the
    right; ``title`` is read to those who cannot see it.
    """
    views = [(words, silhouettes(body, q, eye)) for words, eye in _VIEWS]
    height = max(float(outline[:, 1].max()) for _, outline, _ in views[0][1])
    scale, drawn, left = _TALL / max(height, 1.2), list[str](), 0.0
    for words, parts in views:
        across = np.concatenate([outline[:, 0] for _, outline, _ in parts])
        wide = scale * float(np.ptp(across))
        room = max(wide, _LABEL)
        start = left + (room - wide) / 2 - scale * float(across.min())
        for name, outline, _ in sorted(parts, key=lambda one: one[2]):
            path = " ".join(f"{start + scale * u:.1f},{_TALL - scale * z:.1f}" for u, z in outline)
            drawn.append(f'<polygon points="{path}" fill="{_colour(name)}"/>')
        drawn.append(f'<text x="{left + room / 2:.0f}" y="{_TALL + 14:.0f}">{words}</text>')
        left += room + _GAP
    return (
        f'<svg role="img" aria-label="{title}" viewBox="-3 -6 {left:.0f} {_TALL + 22:.0f}" stroke="#fff" '
        f'stroke-width="0.8">{"".join(drawn)}</svg>'
    )


def _colour(segment: str) -> str:
    side = segment.partition("_")[0]
    return SIDE_COLOURS[side][0] if side in SIDE_COLOURS and side != "middle" else _MIDDLE


def cards_page(result: DanceResult) -> str:
    """Return the page (HTML) of a dance that keeps its limits."""
    from markupsafe import Markup

    dance = result.dance
    assert dance is not None
    postures, cues = held_postures(dance).q, []
    for p, (said, stance) in enumerate(zip(dance_instructions(dance), dance.stances, strict=True)):
        name, feet = dance.names[p] if dance.names else "posture", stance_words(stance)
        title = f"{p + 1}. {name}, {feet}"
        picture = Markup(mannequin_svg(dance.body, postures[p], str(Markup.escape(title))))
        cues.append(
            {"number": p + 1, "name": name[:1].upper() + name[1:], "feet": feet, "said": said, "picture": picture}
        )
    return render(
        "cues.html.j2",
        name=dance.protocol,
        count=len(cues),
        minutes=f"{dance.duration / 60:.1f} minutes",
        move=f"{float(np.median(dance.move)):g}",
        hold=f"{float(np.max(dance.hold)):g}",
        about=result.about,
        unsafe=not_safe(dance),
        right="blue",
        left="orange",
        cues=cues,
    )
