"""What moved, beside what the laboratory's own software wrote into the same real files: joint angles and events.

BIODANCE_DATA=DIR python benchmarks/bench_movement.py [SESSION ...] -> a table by angle and one by event, and how much
later the markers tell an event than the plates. Budget: 12 s a session.
"""

import os
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

import biodance

SESSIONS = ("biomechzoo/HC0*", "c3d_parser_Sydney*", "c3d_parser_QCMAS*", "gaitalytics*")


def folders(data: Path, named: list[str]) -> list[Path]:
    """Return the session folders to look at."""
    return [data / name for name in named] or [one for some in SESSIONS for one in sorted(data.glob(some))]


def moved_trials(folder: Path):
    """Yield what moved in every moving trial of a session; say what gives nothing."""
    try:
        result = biodance.examine(biodance.read_session(folder))
    except biodance.BiodanceError as why:
        print(f"{folder.name}: {str(why)[:150]}")
        return
    for one in biodance.describe_movement(result):
        if result[one.trial].trial.role != "static":
            yield one


def main() -> None:
    """Print the tables."""
    angles, events, late = defaultdict(list), defaultdict(list), defaultdict(list)
    for folder in folders(Path(os.environ["BIODANCE_DATA"]), sys.argv[1:]):
        for one in moved_trials(folder):
            print(f"{folder.name} {one.trial}: {one.told}", flush=True)
            for a in one.file_angles:
                angles[a.joint.partition("_")[2]].append((a.offset, a.sd, a.correlation))
                print(f"    {a.joint:28s} offset {a.offset:+5.1f} sd {a.sd:4.1f} deg, correlation {a.correlation:.3f}")
            for e in one.file_events:
                events[e.down].append((e.late, e.sd, e.count, e.missed))
            for down, some in zip((True, False), one.late, strict=True):
                late[down] += some.tolist()
    print("| angle | legs | offset, mean (range) deg | sd about it deg | correlation, median (least) |")
    for name, rows in angles.items():
        offset, sd, cc = np.array(rows).T
        span = f"{offset.mean():+.1f} ({offset.min():+.1f} to {offset.max():+.1f})"
        print(f"| {name} | {len(rows)} | {span} | {np.median(sd):.1f} | {np.nanmedian(cc):.3f} ({np.nanmin(cc):.3f}) |")
    for down, rows in events.items():
        mean, sd, count, missed = np.array(rows).T
        all_in = np.nansum(mean * count) / count.sum()
        print(
            f"{'strikes' if down else 'leavings'}: {count.sum():.0f} events, {missed.sum():.0f} missed, "
            f"{1000 * all_in:+.0f} ms, sd within a trial {1000 * np.nanmedian(sd):.0f} ms"
        )
    for down, some in late.items():
        if some:
            print(
                f"{'strikes' if down else 'leavings'}, markers after plates: {len(some)}, "
                f"{1000 * np.mean(some):+.0f} ms, sd {1000 * np.std(some):.0f} ms"
            )


if __name__ == "__main__":
    main()
