"""One tracked trial as the effects see it: what was measured, how the body moved, and which wrench that motion
needs.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from biodance.body.body import Body
from biodance.effects._base.geometry import Geometry, GeometryChanges, geometry
from biodance.errors import TrialRefused, UnknownName
from biodance.lab.prepare import motion_filter
from biodance.motion.dynamics import wrench_of_segments
from biodance.motion.kinematics import Poses, SegmentMotion, poses, segment_motion
from biodance.records import Array, Motion, Plate, Trial, Wrench, freeze
from biodance.spatial import wrench_about_point

OF_MOTION = ("segments", "poses", "marker_columns", "measured_markers", "marker_residual", "memory")
"""What a case computes once from body, motion and markers, whatever the forces and the parameters."""
_ALIKE = 0.3
"""Share of a segment's mass by which it may change before the answers to changes of the geometry are computed again:
they are that much wrong at most, in causes whose sizes are uncertain to a tenth anyway; computing them is half of all
work.
"""


@dataclass(frozen=True, eq=False)
class Case:
    """A prepared ``trial`` (plates at marker times) with the ``motion`` of ``body`` in it and the parameters ``phi``
    (10N,) in use.

    ``session_time`` (T,) runs from 0 at the start of the session to 1 at its end, for causes that grow with time.
    """

    body: Body
    trial: Trial
    motion: Motion
    phi: Array
    session_time: Array

    def __post_init__(self) -> None:
        frames = self.motion.time.size
        freeze(self, "Case", phi=(10 * len(self.body.segments),), session_time=(frames,))
        if len(self.measured) != frames:
            raise TrialRefused(
                f"Trial {self.trial.name}: {frames} frames of motion, other samples of force; prepare the trial first."
            )

    @cached_property
    def segments(self) -> SegmentMotion:
        """Spatial motion of all segments in the lab frame."""
        return segment_motion(self.body, self.motion, pose=self.poses)

    @cached_property
    def predicted(self) -> Array:
        """(T, 6) N, N·m wrench about the lab origin that the motion needs. Candidate causes are built from this one,
        never from the measured wrench: columns of measured channels reproduce any residual exactly.
        """
        return self.needed(self.phi)

    def needed(self, phi: Array) -> Array:
        """Return (T, 6) N, N·m the wrench about the lab origin that the motion needs of the parameters ``phi``
        (10N,).
        """
        return wrench_of_segments(self.body, self.segments, phi)

    def needed_by(self, load: Array, segment: int) -> Array:
        """Return (T, 6) N, N·m the wrench about the lab origin that a ``load`` (10,) fixed to a segment needs."""
        phi = np.zeros_like(self.phi)
        phi[10 * segment : 10 * segment + 10] = load
        return self.needed(phi)

    @cached_property
    def measured(self) -> Array:
        """(T, 6) N, N·m wrench of all plates about the lab origin."""
        return self.trial.wrench.value

    @cached_property
    def residual(self) -> Array:
        """(T, 6) N, N·m measured minus predicted wrench about the lab origin."""
        return self.measured - self.predicted

    @cached_property
    def poses(self) -> Poses:
        """Poses of all segments in the lab frame."""
        return poses(self.body, self.motion.q)

    @cached_property
    def marker_columns(self) -> tuple[int, ...]:
        """(K) indices in ``body.markers`` of the markers that the trial has, in the body's order."""
        markers = self.trial.markers
        return () if markers is None else tuple(i for i, name in enumerate(self.body.markers.names) if name in markers)

    @cached_property
    def measured_markers(self) -> Array:
        """(T, K, 3) m the recorded markers ``marker_columns``, NaN = not seen."""
        markers, frames = self.trial.markers, self.motion.time.size
        if markers is None or not self.marker_columns:
            return np.empty((frames, 0, 3))
        return markers.select(self.body.markers.names[i] for i in self.marker_columns).xyz

    @cached_property
    def marker_residual(self) -> Array:
        """(K, 3) m mean over time of measured minus model marker, in the axes of the marker's segment; zero for a
        marker never seen.
        """
        columns = list(self.marker_columns)
        segment = [self.body.markers.segment[c] for c in columns]
        apart = self.measured_markers - self.poses.points(segment, self.body.markers.position[columns])
        # R' (measured - model): sum over i of R[t, k, i, j] d[t, k, i].
        local = np.einsum("tkij,tki->tkj", self.poses.rotation[:, segment], apart)
        seen = np.isfinite(local)
        return np.asarray(np.where(seen, local, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1))

    @cached_property
    def memory(self) -> dict[str, object]:
        """What was computed of the motion and the markers and serves again, by name; nothing that depends on forces
        or parameters.
        """
        return {}

    @cached_property
    def geometry(self) -> GeometryChanges:
        """How wrench and markers answer to changes of the body's geometry."""
        return self.body_geometry().changes

    def body_geometry(self) -> Geometry:
        """Return what the trial says about its body's geometry, posture and all: large, and not kept."""
        return geometry(
            self.body,
            self.motion,
            self.phi,
            poses=self.poses,
            segments=self.segments,
            columns=self.marker_columns,
            measured=self.measured_markers,
            smoothed=motion_filter(self.trial.settings),
        )

    def plate(self, name: str) -> Plate:
        """Return a plate by name; UnknownName lists the trial's plates."""
        for plate in self.trial.plates:
            if plate.name == name:
                return plate
        raise UnknownName.of("force plate of this trial", name, [plate.name for plate in self.trial.plates])

    def predicted_on(self, plate: Plate) -> Array:
        """Return the predicted wrench (T, 6) of one plate about its centre, lab axes: its share of the vertical
        force times the whole.
        """
        total = self.measured[:, 2]
        # Below a newton there is no share to speak of: the plates are taken alike.
        safe = np.where(np.abs(total) > 1.0, total, 1.0)
        share = np.where(np.abs(total) > 1.0, plate.wrench.value[:, 2] / safe, 1.0 / len(self.trial.plates))
        value = self.predicted * (np.ones_like(share) if len(self.trial.plates) == 1 else share)[:, None]
        return wrench_about_point(value, plate.centre)

    def with_added(self, plate: Plate, change: Array) -> "Case":
        """Return the case with ``change`` (T, 6) about the lab origin added to what ``plate`` measured."""
        value = plate.wrench.value + change
        value.setflags(write=False)  # the record keeps it without a copy
        changed = replace(plate, wrench=Wrench(plate.wrench.time, value))
        plates = tuple(changed if p.name == plate.name else p for p in self.trial.plates)
        changed_trial = replace(self.trial, plates=plates)
        return self._known(replace(self, trial=changed_trial), *OF_MOTION, "predicted", "geometry")

    def with_parameters(self, phi: Array) -> "Case":
        """Return the case with the parameters ``phi`` (10N,) in use; what moved joints would do stays while the
        masses are `ALIKE`.
        """
        known = self.__dict__.get("geometry")
        used = self.body.link_parameters(self.phi) if known is None else known.phi
        before, now = (np.asarray(p)[::10] for p in (used, self.body.link_parameters(phi)))
        same = bool(np.all(np.abs(now - before) <= _ALIKE * np.abs(before)))
        return self._known(replace(self, phi=phi), *OF_MOTION, *(("geometry",) if same else ()))

    def _known(self, other: "Case", *names: str) -> "Case":
        """Return ``other``, a case of the same motion, with what was computed here already."""
        other.__dict__.update({name: self.__dict__[name] for name in names if name in self.__dict__})
        return other
