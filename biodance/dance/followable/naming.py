"""What a posture of known words is called."""

from biodance.dance.followable.reach import DanceStep
from biodance.dance.followable.vocabulary import Word, singular


def name_of(step: DanceStep) -> str:
    """Return what a posture is called: the words of all parts that do not rest; of arms that do the same, once."""
    words = step.words
    out = []
    for part, word in words.items():
        if part.endswith("_arm") or part.endswith("_hanging"):
            continue
        if not word.rest or part.endswith("_lifted"):
            out.append(word.text)
    for kind in ("arm", "hanging"):
        pair = [words[f"{side}_{kind}"] for side in ("right", "left") if f"{side}_{kind}" in words]
        out += _pair_words(pair)
    return ", ".join(out) or ("sit" if "right_hanging" in words else "stand")


def _pair_words(pair: list[Word]) -> list[str]:
    if not pair or all(word.rest for word in pair):
        return []
    if pair[0].key == pair[1].key:
        return [pair[0].text.format("both")]
    sides = zip(("the right", "the left"), pair, strict=True)
    return [singular(word.text.format(side)) for side, word in sides if not word.rest]
