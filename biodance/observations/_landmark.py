"""How far the markers of the feet may lie beside where the laboratory says: unknown, and common to both feet.

A toe marker on the first ray instead of the second puts the pressure outwards on BOTH feet; a right foot on one plate
and a left foot on another then look like two plates shifted in opposite directions. Only what the feet do not share
speaks of plates. The farther ahead the pressure lies, the more the toe marker's place matters: at the heel not at all.
"""

from biodance.observations._feet import FootPath

LANDMARK = "toe landmark"
"""What the names of the errors hold that both feet share because of where their markers sit."""
_ACROSS = {False: 0.025, True: 0.010}
"""m: sd of the toe end of the foot's line across the foot; True: by markers on the edges of the forefoot. In ten
laboratories the pressure lay 12 mm (sd 12) outwards in the middle of stance, where 0.7 of it is seen (0 to 4 mm with
the marker on the second ray, 17 to 41 mm on the first); by the edges 5 mm in seven laboratories.
"""
_ALONG = 0.012
"""m: sd of the heel end along the foot: 11 mm early in stance in twelve laboratories (heel pads, shoes, wands)."""
_OWN = {"across": 0.008, "along": 0.004}
"""m: the same of one foot beside the other: half the difference of the feet 5.6 mm (ten laboratories) in the middle of
stance, of which the pressure's own path takes a part (`foot_across`)."""
LEVERS = {"early": 0.35, "middle": 0.7, "late": 1.0, "running": 0.7}
"""Share of the toe end's place across the foot that is seen in a phase: how far ahead the pressure lies."""


def landmark_across(foot: FootPath, phase: str) -> dict[str, float]:
    """Return m by name: errors of the pressure's place across a ``foot`` in a phase of stance due to its markers."""
    lever, by = LEVERS[phase], " by edges" if foot.by_edges else ""
    return {
        f"laboratory {LANDMARK}{by}, across": lever * _ACROSS[foot.by_edges],
        f"person {foot.side} toe, across": lever * _OWN["across"],
    }


def landmark_along(foot: FootPath) -> dict[str, float]:
    """Return m by name: errors of the pressure's place along a ``foot`` due to its heel marker, in all phases."""
    return {f"laboratory {LANDMARK}, along": _ALONG, f"person {foot.side} heel, along": _OWN["along"]}


def shift_per_sd(norm: str) -> float:
    """Return how many m of the toe end (across) or heel end (along) one standard deviation of a shared error is."""
    return _ALONG if norm.endswith("along") else _ACROSS[" by edges" in norm]
