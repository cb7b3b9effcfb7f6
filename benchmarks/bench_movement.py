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
from biodance.lab.c3d.raw import read_raw, split_label
from biodance.motion.contact.contact import foot_wrenches
from biodance.motion.contact.soles import soles_from_body
from biodance.motion.dynamics import joint_torques
from biodance.pipeline.export import body_of_result
from biodance.pipeline.trial import contact_of
from biodance.records import SIDES

MOMENTS = {
    "hip_flexion": ("HipMoment", 0),
    "hip_adduction": ("HipMoment", 1),
    "knee_flexion": ("KneeMoment", 0),
    "ankle_dorsiflexion": ("AnkleMoment", 0),
}
"""Plug-in gait's moments: N·mm per kg, positive against our angles (extensors, abductors, plantar flexors)."""
SESSIONS = ("biomechzoo/HC0*", "c3d_parser_Sydney*", "c3d_parser_QCMAS*", "gaitalytics*")


def folders(data: Path, named: list[str]) -> list[Path]:
    """Return the session folders to look at."""
    return [data / name for name in named] or [one for some in SESSIONS for one in sorted(data.glob(some))]


def examined(folder: Path):
    """Return the examined session, or None; say why."""
    try:
        return biodance.examine(biodance.read_session(folder))
    except biodance.BiodanceError as why:
        print(f"{folder.name}: {str(why)[:150]}")
        return None


def moments_beside(result, one):
    """Yield joint, RMS difference (N·m/kg) and correlation of the moments of a leg that stands, ours and the file's."""
    body, _ = body_of_result(result)
    contact = contact_of(one.trial, one, body)
    if contact is None:
        return
    ground = foot_wrenches(one.trial, contact, soles_from_body(body, one.motion))
    torque = joint_torques(body, one.motion, ground).torque / body.sip.mass.sum()
    raw = read_raw(one.trial.source.path)
    labels = [split_label(label)[1] for label in raw.labels]
    for foot, side in enumerate(SIDES):
        stands = contact.told[:, foot] & (ground[f"{side}_foot"].force[:, 2] > 50)
        for joint, (name, axis) in MOMENTS.items():
            if (label := f"{side[0].upper()}{name}") not in labels:
                continue
            theirs = -raw.points[:, labels.index(label), axis] / 1000
            known = stands & np.isfinite(theirs) & (theirs != 0)
            ours = torque[known, body.joint_index(f"{side}_{joint}")]
            if known.sum() >= 20:
                apart = ours - theirs[known]
                yield joint, float(np.sqrt(np.mean(apart**2))), float(np.corrcoef(ours, theirs[known])[0, 1])


def main() -> None:
    """Print the tables."""
    angles, events, late, moments = (defaultdict(list) for _ in range(4))
    for folder in folders(Path(os.environ["BIODANCE_DATA"]), sys.argv[1:]):
        if (result := examined(folder)) is None:
            continue
        for one in biodance.describe_movement(result):
            if result[one.trial].trial.role == "static":
                continue
            for joint, rms, cc in moments_beside(result, result[one.trial]):
                moments[joint].append((rms, cc))
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
    print("| moment of a leg that stands | legs | RMS difference, median N·m/kg | correlation, median (least) |")
    for name, rows in moments.items():
        rms, cc = np.array(rows).T
        print(f"| {name} | {len(rows)} | {np.median(rms):.2f} | {np.median(cc):.3f} ({cc.min():.3f}) |")
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
