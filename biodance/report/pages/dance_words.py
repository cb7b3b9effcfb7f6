"""What is said of a dance on its cards and its page, in the language of a catalogue: what is put together of parts
stands here whole, so that every part is in the catalogue.
"""

import re
from collections.abc import Callable, Iterable

from biodance.dance.cues import Say
from biodance.report.pages.language import N_

COMPOSED = (
    *(N_("both arms"), N_("the right arm"), N_("the left arm")),
    *(N_("both upper arms"), N_("the right upper arm"), N_("the left upper arm")),
    *(N_("both elbows"), N_("the right elbow"), N_("the left elbow")),
    *(N_("both thighs"), N_("the right thigh"), N_("the left thigh")),
    *(N_("both legs"), N_("the right leg"), N_("the left leg")),
    *(N_("both knees"), N_("the right knee"), N_("the left knee")),
    *(N_("both feet"), N_("the right foot"), N_("the left foot")),
    *(N_("hold the frame with both hands"), N_("hold the frame with the right hand")),
    *(N_("hold the frame with the left hand"), N_("mirror: the same with right and left exchanged")),
    *(N_("step forward with the right foot"), N_("set the right foot back beside the left one")),
    *(N_("set the right foot down"), N_("set the left foot down")),
    *(N_("shift your weight onto the right leg"), N_("shift your weight onto the left leg")),
    *(N_("with both feet side by side"), N_("with the right foot in front"), N_("on the stool")),
    *(N_("with both feet side by side, the weight on the right one"),),
    *(N_("with both feet side by side, the weight on the left one"),),
    *(N_("with the right foot in front, the weight on the right one"),),
    *(N_("with the right foot in front, the weight on the left one"),),
    *(N_("on the right leg alone"), N_("on the left leg alone")),
    N_("Then rest: let the arms down. Take up this posture again when you are ready."),
)
"""What is called, where the feet are, and when to rest."""
SHOWN = (
    *(N_("pelvis"), N_("trunk and head")),
    *(N_("left thigh"), N_("left shank"), N_("left foot"), N_("left upper arm"), N_("left forearm and hand")),
    *(N_("right thigh"), N_("right shank"), N_("right foot"), N_("right upper arm"), N_("right forearm and hand")),
    *(N_("left shoulder"), N_("left elbow"), N_("left wrist"), N_("left knee")),
    *(N_("right shoulder"), N_("right elbow"), N_("right wrist"), N_("right knee")),
    *(N_("higher"), N_("lower"), N_("further to your left"), N_("further to your right")),
    *(N_("left arm lifted"), N_("left elbow bent"), N_("left hip bent"), N_("left knee bent")),
    *(N_("right arm lifted"), N_("right elbow bent"), N_("right hip bent"), N_("right knee bent")),
)
"""Names that the page's script takes from its data."""
_SAID = re.compile(r'\bsay\(\s*"((?:[^"\\]|\\.)*)"')


def posture_said(name: str, say: Say) -> str:
    """Return the ``name`` of a posture, its parts (`posture_phrases`) said one by one."""
    return ", ".join(say(part) for part in name.split(", "))


def script_words(scripts: Iterable[str], translated: Callable[[str], str]) -> dict[str, str]:
    """Return what ``scripts`` say, and the names in their data, each beside its translation, places left open."""
    return {text: translated(text) for script in scripts for text in (*_SAID.findall(script), *SHOWN)}
