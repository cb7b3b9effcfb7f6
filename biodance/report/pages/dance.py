"""The cards of a dance: a page to print, a picture and the instructions of every posture on a card of its own."""

from pathlib import Path

import numpy as np

from biodance.dance.cues import dance_instructions
from biodance.dance.problem.stance import stance_words
from biodance.pipeline.dance_result import DanceResult
from biodance.report.figures.mannequin import mannequin_svg


def cards_page(result: DanceResult) -> str:
    """Return the page (HTML) of a dance that keeps its limits."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    dance = result.dance
    assert dance is not None
    x = [dance.chain.plant(x[None], s.planted, s.ankle)[0] for x, s in zip(dance.postures, dance.stances, strict=True)]
    motion = dance.chain.motion(np.arange(len(x), dtype=float), np.array(x), *np.zeros((2, *np.shape(x))))
    cues = []
    for p, (said, stance) in enumerate(zip(dance_instructions(dance), dance.stances, strict=True)):
        name, feet = dance.names[p] if dance.names else "posture", stance_words(stance)
        title = f"{p + 1}. {name}, {feet}"
        picture = Markup(mannequin_svg(dance.body, motion.q[p], str(Markup.escape(title))))
        cues.append(
            {"number": p + 1, "name": name[:1].upper() + name[1:], "feet": feet, "said": said, "picture": picture}
        )
    folder = Path(__file__).parents[1] / "templates"
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string((folder / "cues.html.j2").read_text(encoding="utf-8")).render(
        name=dance.protocol,
        count=len(cues),
        minutes=f"{dance.duration / 60:.1f} minutes",
        move=f"{float(np.median(dance.move)):g}",
        hold=f"{float(np.max(dance.hold)):g}",
        about=[sentence for sentence in result.about if sentence not in result.warnings],
        warnings=result.warnings,
        right="blue",
        left="orange",
        cues=cues,
    )
