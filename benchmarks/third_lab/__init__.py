"""A third gait laboratory: people, movements, plates and cameras that share no line with what they test.

A clean room. Whoever wrote it had not read the package that it tests, nor the other laboratories: person, mechanics,
soft tissue, plates and files come from published studies, pinocchio and ezc3d. `make_session` makes a session with its
truth beside it, the same for the same seed: a folder OUT (static, stand, six dances, two squats), and in OUT.truth.json
what is true: masses, centres of mass and inertia per segment, and lumped to the seven kinds of segments that a coarser
body has; the laboratory; the fault and its size.

What is unlike usual practice: 22 segments with a spine of three joints, clavicles and toes; a pelvis that has 11 to
20 % of the body by person; knees that screw home; masses drawn between five studies; soft tissue that wobbles and sags;
skin that follows joint angles and rings; balance by the zero-moment point; C3D by ezc3d, lab frames with y or z up.

Frames: the world of this laboratory is z up, x along the walkway, SI. A segment's frame lies at its proximal joint,
with the axes of upright standing: x ahead, y left, z up.
"""

from benchmarks.third_lab.faults import FAULTS, Fault
from benchmarks.third_lab.session import make_session

__all__ = ["FAULTS", "Fault", "make_session"]
