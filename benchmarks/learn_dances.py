"""Learn the noise of dances that virtual people performed: writes anthropometry/uncertainty/dances.toml anew.

    OMP_NUM_THREADS=1 python benchmarks/learn_dances.py FOLDER [--dance short] [--out FILE]

FOLDER is that of bench_chain.py: the sessions of its people with this dance (performer normal) are read, tracked and
identified anew. The noise is the root mean square over people of the standard deviations that identification
learned, band by band and channel by channel; the sizes are the medians of those that the evidence chose. What designs
of dances expect beforehand rests on this file.
"""

import argparse
from pathlib import Path

import numpy as np

from biodance.lab.session.read import read_session
from biodance.pipeline.session import examine, identification_of
from biodance.records import Array

_HEAD = '''origin = """\\
{count} virtual people who danced the followable {dance} with realistic tolerances (performer normal), joints placed by
functional calibration; root mean square over them; benchmarks/learn_dances.py"""
unit = "N, N m: standard deviation of one coefficient at 25 Hz, per band of uncertainty.bands.BANDS and channel"
'''


def left(place: Path) -> tuple[Array, Array]:
    """Return what identification found in a session: noise (B, 6) N and N m, sizes (2,) of kinematics and noise."""
    found = identification_of(examine(read_session(place))).identification
    noise = np.sqrt(np.array([np.diag(band) for band in found.noise.covariance]))
    print(place.name, found.sizes, noise.round(1).tolist(), flush=True)
    return noise, np.array([found.sizes.kinematics, found.sizes.noise])


def main() -> None:
    """Learn and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--dance", default="short")
    parser.add_argument("--out", type=Path, default=Path("anthropometry/uncertainty/dances.toml"))
    chosen = parser.parse_args()
    places = sorted((chosen.folder / "sessions").glob(f"*_{chosen.dance}_normal"))
    noises, sizes = (np.array(some) for some in zip(*map(left, places), strict=True))
    rows = np.sqrt(np.mean(np.square(noises), axis=0))
    kinematics, noise = np.median(sizes, axis=0)
    table = ",\n".join(f"  [{', '.join(f'{value:.1f}' for value in row)}]" for row in rows)
    chosen.out.write_text(
        f"{_HEAD.format(count=len(places), dance=chosen.dance)}noise = [\n{table},\n]\n\n[sizes]\n"
        f"kinematics = {kinematics:.2g}\nnoise = {noise:.2g}\n",
        encoding="utf-8",
    )
    print(f"wrote {chosen.out} from {len(places)} sessions")


if __name__ == "__main__":
    main()
