"""Forces of the ground on segments written for OpenSim: the table, and the files that say what its columns are."""

from collections.abc import Mapping
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from biodance.lab.opensim import Y_UP_TO_Z_UP
from biodance.lab.opensim.mot import TimeTable
from biodance.records import Array, Wrench
from biodance.settings import COP_FORCE
from biodance.spatial import wrench_about_point

_VERSION = "40000"
_AXES = "xyz"


def ground_table(feet: Mapping[str, Wrench], *, name: str) -> TimeTable:
    """Return the ground's force on each segment as a table, y up: nine columns a segment, its name in front.

    ``feet`` segment -> wrench of the ground on it about the lab origin. Force and torque stand at one point of the
    ground that does not move, the mean centre of pressure: a centre of pressure that jumps with every step has no
    derivative, and OpenSim draws splines through it.
    """
    columns, values = [], []
    for segment, wrench in feet.items():
        point = np.broadcast_to(_mean_place(wrench), (wrench.time.size, 3))
        torque = wrench_about_point(wrench.value, point)[:, 3:]
        columns += [f"{segment}_{part}{axis}" for part in ("force_v", "force_p", "torque_") for axis in _AXES]
        values += [part @ Y_UP_TO_Z_UP for part in (wrench.force, point, torque)]
    return TimeTable(name, tuple(columns), next(iter(feet.values())).time, np.hstack(values))


def _mean_place(wrench: Wrench) -> Array:
    """Return the mean centre of pressure (3,) m on the floor z = 0; the origin where the foot carries nothing."""
    cop = wrench.cop(height=0.0, threshold=COP_FORCE)
    known = np.isfinite(cop).all(axis=1)
    return np.asarray(cop[known].mean(axis=0)) if known.any() else np.zeros(3)


def external_loads(segments: tuple[str, ...], *, data_file: str) -> str:
    """Return ExternalLoads.xml: the columns of `ground_table` in ``data_file`` on their segments, in the ground."""
    root = Element("OpenSimDocument", Version=_VERSION)
    loads = SubElement(root, "ExternalLoads", name="ground")
    objects = SubElement(loads, "objects")
    for segment in segments:
        force = SubElement(objects, "ExternalForce", name=f"ground_on_{segment}")
        _say(force, applied_to_body=segment, force_expressed_in_body="ground", point_expressed_in_body="ground")
        _say(force, force_identifier=f"{segment}_force_v", point_identifier=f"{segment}_force_p")
        _say(force, torque_identifier=f"{segment}_torque_", data_source_name="Unassigned")
    _say(loads, datafile=data_file)
    return _text(root)


def inverse_dynamics_setup(
    name: str, *, model: str, coordinates: str, loads: str, between: tuple[float, float], out: str
) -> str:
    """Return the set-up of OpenSim's InverseDynamicsTool: files relative to its own, times s; no filter, since the
    coordinates are smooth already.
    """
    root = Element("OpenSimDocument", Version=_VERSION)
    tool = SubElement(root, "InverseDynamicsTool", name=name)
    _say(tool, results_directory=".", model_file=model, time_range=f"{between[0]:.10g} {between[1]:.10g}")
    _say(tool, forces_to_exclude="Muscles", external_loads_file=loads, coordinates_file=coordinates)
    _say(tool, lowpass_cutoff_frequency_for_coordinates="-1", output_gen_force_file=out)
    return _text(root)


def _say(parent: Element, **values: str) -> None:
    for tag, value in values.items():
        SubElement(parent, tag).text = value


def _text(root: Element) -> str:
    indent(root, space="  ")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"
