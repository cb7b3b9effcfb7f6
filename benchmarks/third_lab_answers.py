"""What a diagnosis of a session of the third laboratory is worth: names and sizes against the truth."""

from typing import Any

import numpy as np
from third_lab.markers import name_markers
from third_lab.write import lump_of

from biodance.records import Array

Row = dict[str, Any]
NO_LABEL = "no label"


def expected(true: Row, turn: Array) -> tuple[dict[str, float | None], set[str]]:
    """Return the names that tell the fault, each with the size it should have, and names that are no false ones beside.

    A size is signed as the package's files in `effects` say, and counts the tolerance that the plate has anyway; None
    where a name has none. ``turn`` (3, 3) carries the laboratory's world into the package's.
    """
    fault = true["fault"]
    kind, target, size = fault["kind"], fault["target"], fault["size"]
    plates = true["plates"]
    labels = name_markers(true["room"]["marker_set"])

    if kind.startswith("plate_"):
        plate = {key: np.array(value) for key, value in plates[int(target[-1]) - 1].items() if key != "make"}
        places = {"plate_place": -plate["shift"], "plate_offset": plate["turn"] @ plate["offset"][:3]}
        if kind in places:
            lab, way = turn @ places[kind], turn @ plate["turn"][:, "xyz".index(fault["axis"])]
            i = int(np.abs(way).argmax())
            name = f"plate_position {target}:" if kind == "plate_place" else f"plate_offset {target}:F"
            return {name + "xyz"[i]: float(lab[i])}, set()
        if kind == "plate_yaw":
            return {f"plate_rotation {target}:z": -float(plate["yaw"])}, set()
        return {f"plate_gain {target}:Fz": float(plate["response"][2, 2] - 1)}, set()
    if kind.startswith("load_"):
        return {f"added_mass {lump_of(target)}": size}, set()
    wrist = "/".join(sorted(labels.get(f"{target}_{end}", NO_LABEL) for end in ("radial", "ulnar")))
    knee, side = labels.get(target, NO_LABEL), target.split("_")[0]
    return {
        "none": ({}, set()),
        "force_delay": ({"time_delay": plates[0]["delay"]}, set()),
        "knee_moved": ({f"marker_misplaced {knee}": abs(size)}, set()),
        "knee_misplaced": ({f"joint_centre {side}_knee": None}, {f"segment_length {side}_thigh"}),
        "labels_exchanged": ({f"labels_swapped {wrist}": None}, set()),
        "wrong_mass": ({"body_mass": -size}, set()),
        "force_filter": ({"filter_mismatch": size}, set()),
        "rail": ({f"external_contact {target.replace('hand', 'forearm_hand')}": size}, set()),
        "lab_tilt": ({"lab_tilt x": abs(size), "lab_tilt y": abs(size)}, set()),
    }[kind]  # fmt: skip


def answer(found: Any, true: Row, turn: Array) -> Row:
    """Return the verdict on one session: what was named, what of it is false, sizes beside the truth."""
    one = found.diagnosis
    right, beside = expected(true, turn)
    findings = [(f"{finding.effect} {finding.target}".strip(), finding) for finding in one.findings]
    sizes, in_set = [], False
    for name, finding in findings:
        aliases = {f"{alias.effect} {alias.target}".strip() for alias in finding.set}
        in_set = in_set or bool(aliases & set(right))
        if right.get(name) is not None and finding.parameters:
            value, sd = _size(finding)
            sizes.append((name, value, sd, right[name], bool(abs(value - right[name]) < 1.96 * sd)))
    named = [name for name, _ in findings]
    head = next((said.text for said in one.attention if said.about == "diagnosis"), one.told)
    return {
        "verdict": one.verdict,
        "headline": head,
        "cannot_tell": head.lower().startswith("cannot tell"),
        "named": named,
        "right": sorted(right),
        "exact": any(name in right for name in named),
        "in_set": in_set or any(name in right for name in named),
        "false": [name for name in named if name not in right and name not in beside],
        "sizes": sizes,
        "resembles": [f"{other.effect} {other.target}".strip() for other in one.resembles],
        "tolerated": [repr(other) for other in one.tolerated],
        "worst": [(a.channel, list(a.band_hz), round(float(a.z), 1)) for a in one.adequacy[:3]],
        "notes": list(one.notes),
    }


def _size(finding: Any) -> tuple[float, float]:
    """Return size and standard deviation of a finding; of a vector its length."""
    parts = [one for one in finding.parameters if one.name.startswith(finding.parameters[0].name.split("_")[0])]
    if len(parts) == 1:
        value, sd = parts[0].value, parts[0].sd
        return (abs(value), sd) if finding.effect == "lab_tilt" else (value, sd)
    values, sds = np.array([(one.value, one.sd) for one in parts]).T
    length = float(np.linalg.norm(values))
    return length, float(np.sqrt(np.sum((values * sds) ** 2)) / max(length, 1e-12))


def diagnosis_table(rows: list[Row]) -> list[str]:
    """Return counts, then every session, as lines of Markdown."""
    clean, faulty = (
        [row["answer"] for row in rows if (row["fault"]["kind"] == "none") == want] for want in (True, False)
    )
    sizes = [size for one in faulty for size in one["sizes"]]

    def count(some: list[Row], test: Any) -> str:
        return f"{sum(bool(test(one)) for one in some)} of {len(some)}"

    def alarm(one: Row) -> bool:
        return bool(not one["named"] and one["verdict"] != "nothing wrong" and not one["cannot_tell"])

    def unsure(one: Row) -> bool:
        return bool(one["cannot_tell"] and not one["named"])

    lines = [
        "| | sessions |",
        "|---|---|",
        f"| without fault: a false name | {count(clean, lambda one: one['named'])} |",
        f"| ... an alarm without a name | {count(clean, alarm)} |",
        f'| ... "cannot tell", with its reason | {count(clean, unsure)} |',
        f'| with a fault: not "nothing wrong" | {count(faulty, lambda one: one["verdict"] != "nothing wrong")} |',
        f"| ... named, first or in a set | {count(faulty, lambda one: one['in_set'])} |",
        f"| ... exactly, and nothing else | {count(faulty, lambda one: one['exact'] and not one['false'])} |",
        f"| ... an innocent named | {count(faulty, lambda one: one['false'])} |",
        f'| ... "cannot tell" | {count(faulty, unsure)} |',
        f"| 95 % interval of the size holds the truth | {sum(size[4] for size in sizes)} of {len(sizes)} |",
        "",
        "| seed, fault | room | verdict | named (false ones marked) | size, truth | worst of what is left |",
        "|---|---|---|---|---|---|",
    ]
    return lines + [_line(row) for row in rows]


def _line(row: Row) -> str:
    fault, room, one = row["fault"], row["room"], row["answer"]
    what = " ".join(filter(None, (fault["kind"], fault["target"], fault["axis"])))
    names = ", ".join(f"{name} (false)" if name in one["false"] else name for name in one["named"]) or "-"
    told = ", ".join(f"{value:.3g} ± {sd:.2g}, {wanted:.3g}" for _, value, sd, wanted, _ in one["sizes"]) or "-"
    verdict = "cannot tell" if one["cannot_tell"] and not one["named"] else one["verdict"]
    worst = "; ".join(f"{channel} {low:g}-{high:g} Hz {z}" for channel, (low, high), z in one["worst"][:1])
    make = f"{room['make']}, {room['up']} up, {1e3 * room['camera_noise']:.2f} mm, {room['marker_set']}"
    return f"| {row['seed']}, {what} | {make} | {verdict} | {names} | {told} | {worst} |"
