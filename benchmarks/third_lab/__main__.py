"""Make one session: python -m third_lab OUT --seed 3 [--fault plate_place] [--set pig]."""

import argparse
from pathlib import Path

from third_lab.faults import FAULTS
from third_lab.session import make_session


def main() -> None:
    """Read the command line and make the session."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--fault", choices=("none", *FAULTS), default="none")
    parser.add_argument("--set", dest="marker_set", choices=("", "pig", "isb", "cgm2"), default="")
    parser.add_argument("--seconds", type=float, default=10.0, help="of each dance")
    parser.add_argument("--quiet", action="store_true", help="ideal instruments, skin and tissue")
    given = parser.parse_args()
    print(make_session(given.out, given.seed, given.fault, given.marker_set, given.seconds, given.quiet))


main()
