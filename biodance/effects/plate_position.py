"""A force plate lies elsewhere than the laboratory's file says."""

from biodance.effects._base.effect import Parameter
from biodance.effects._base.installed_plate import InstalledPlate
from biodance.effects._base.quality_check import Quantity
from biodance.effects._base.words import MEASURE_CORNERS, About, CauseWords, CheckKind
from biodance.lab.plates.faults import POSITION


class PlatePosition(InstalledPlate):
    """A ``shift`` (m) along a lab axis of where the file puts the plate, relative to where it is; target
    ``plate1:x``.
    """

    name = "plate_position"
    fault = POSITION
    by_load = True
    prior = 0.04
    parameters = (
        Parameter(
            "shift",
            "m",
            0.010,
            "centre-of-pressure errors up to 30 mm (PMID 11091955); 1-2 mm wand errors",
            # m that matters: laboratories that check have 2 to 5 mm and 0.2 degrees (Collins
            # 2009, doi:10.1016/j.gaitpost.2008.10.060).
            least=0.003,
            # m up to which laboratories have it without calling it a fault: plates 2 to 5 mm off
            # (Collins 2009).
            usual=0.006,
            alike=0.005,
        ),
    )
    separated_by = "Standing at several places, squats and a pole pressed onto marked points."
    advice = "Measure the plate's corners with markers and enter them again (FORCE_PLATFORM:CORNERS)."
    about = About(
        what="A force plate lies elsewhere than the laboratory's file says.",
        signature="Moments that follow the force, M = shift x f: for a shift along x mostly My following Fz.",
        look_alikes=(
            "Offset of the moments, cross-talk Fz->Mx or My, and above all the trunk's centre of mass, which other "
            "tools move instead."
        ),
        settled_by=(
            "The centre of pressure against the foot markers, by Fz dynamics, and by a pole pressed on the plate."
        ),
    )
    words = CauseWords(
        "{plate} lies {size}{between} along {axis} from where the file says", MEASURE_CORNERS, "a plate elsewhere"
    )
    explains = (CheckKind.PRESSURE,)
    followed = (
        Quantity("place_x", "m", name, "x", 0.002, 0.003, 0.3, 0.004),
        Quantity("place_y", "m", name, "y", 0.002, 0.003, 0.3, 0.004),
    )
    """Typical sizes of seven real visits of one laboratory (docs/benchmarks/plates.md)."""


EFFECT = PlatePosition
