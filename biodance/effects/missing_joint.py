"""A joint that the body has and the model lacks: tracked again with it, to see how it moves and what that changes in the wrench."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import make_interp_spline

from biodance.body.body import Body
from biodance.body.inertia import Lump, parameters
from biodance.body.tables import numbers, read_table
from biodance.effects.case import Case
from biodance.errors import TrialRefused
from biodance.lab.filters import LowPass, low_pass
from biodance.motion.inverse_kinematics import solve_ik
from biodance.motion.kinematics import poses
from biodance.motion.regressor import predict_wrench
from biodance.motion.smoothing import smooth
from biodance.motion.track import track
from biodance.records import Array, Markers

RATE = 25.0
"""Hz, at least: the low-pass leaves nothing that needs more."""


@dataclass(frozen=True, eq=False)
class Loosened:
    """``wrench`` (T, 6) about the lab origin that the joint's motion adds to the predicted one; ``markers`` (K, 3) m by which the model's
    markers come nearer on average, in segment axes; ``angle`` rad rms of the joint's axes.
    """

    wrench: Array
    markers: Array
    angle: float

    @property
    def columns(self) -> Array:
        """(T, 6, 2) the wrench per radian: of the angle that the markers show, and of more than they show."""
        return np.repeat(self.wrench[:, :, None] / max(self.angle, 1e-6), 2, axis=2)

    @property
    def marker_columns(self) -> Array:
        """(K, 3, 2) m per radian: the mean residual that the angle shown explains."""
        return np.stack([self.markers / max(self.angle, 1e-6), np.zeros_like(self.markers)], axis=2)

    def beyond(self, natural: float) -> Array:
        """Return (2,) rad: the angle that is left when the ``natural`` one is taken off (squares of independent movements add up), and
        NaN for what only the wrench can show.
        """
        return np.array([np.sqrt(max(self.angle**2 - natural**2, 0.0)), np.nan])


def loosened(case: Case, body: Body | None) -> Loosened:
    """Return what the markers show with the joints that ``body`` has beyond ``case.body``; nothing where they do not determine them (None:
    the markers for it are not there).
    """
    nothing = Loosened(np.zeros((case.motion.time.size, 6)), np.zeros_like(case.marker_residual), 0.0)
    if body is None:
        return nothing
    key = ", ".join(joint.name for joint in body.joints)
    if key not in case.memory:
        try:
            case.memory[key] = _tracked(case, body)
        except TrialRefused:
            case.memory[key] = nothing
    found = case.memory[key]
    assert isinstance(found, Loosened)
    return found


def _tracked(case: Case, body: Body) -> Loosened:
    every = slice(None, None, max(1, int(case.motion.rate / RATE + 1e-6)))
    markers, time = case.trial.markers, case.motion.time[every]
    assert markers is not None
    rate = case.motion.rate / (every.step or 1)
    calm = Markers(markers.names, time, low_pass(markers.xyz, case.motion.rate, LowPass())[every])
    gentle = LowPass(cutoff=min(LowPass().cutoff, 0.45 * rate))
    tracked = case.motion.q[every]
    names = {joint.name for joint in case.body.joints}
    new = np.flatnonzero([joint.name not in names for joint in body.joints]) + body.nq - len(body.joints)
    guess = np.insert(tracked, new - np.arange(new.size), 0.0, axis=1)
    loose = smooth(body, time, solve_ik(body, calm, guess=guess).q, settings=gentle)
    stiff = smooth(case.body, time, tracked, settings=gentle)
    change = predict_wrench(body, loose, _parameters(case, body)).value - predict_wrench(case.body, stiff, case.phi).value
    angle = float(np.sqrt(loose.q[:, new].var(axis=0).mean()))
    nearer = _markers(case, body, loose.q, stiff.q)
    return Loosened(make_interp_spline(time, change, k=5)(case.motion.time), nearer, angle)


def _markers(case: Case, body: Body, loose: Array, stiff: Array) -> Array:
    """Return (K, 3) m: the mean step of the model's markers from the postures without to those with the joint, in segment axes."""
    columns = list(case.marker_columns)
    places, markers = case.body.markers, body.markers
    before, after = poses(case.body, stiff), poses(body, loose)
    segment = [places.segment[c] for c in columns]
    step = after.points([markers.segment[c] for c in columns], markers.position[columns]) - before.points(segment, places.position[columns])
    return np.asarray(np.einsum("tkij,tki->kj", before.rotation[:, segment], step) / len(step))


def _parameters(case: Case, body: Body) -> Array:
    """Return the parameters in use of the body with more segments: what was cut off keeps the table's."""
    phi = np.array(body.sip.phi)
    phi[: case.phi.size] += case.phi - case.body.sip.phi
    return phi


def extended(case: Case, body: Body) -> Case:
    """Return the case of the body with more joints, tracked with them."""
    return replace(case, body=body, motion=track(body, case.trial), phi=_parameters(case, body))


def share_of_body(body: Body, segment: str, *, top: Array, bottom: Array) -> Array:
    """Return the ten parameters (10,) of a part of the trunk between ``bottom`` and ``top`` (3,) m, by its name in de Leva's table (mean of
    women and men), in the frame of the two points; masses in proportion to the body's.
    """
    rows = [read_table("segments", "de_leva_1996").row(segment=segment, sex=sex) for sex in ("F", "M")]
    columns = "mass_fraction com_fraction gyration_sagittal gyration_transverse gyration_longitudinal"
    fraction, place, sagittal, transverse, along = np.mean([numbers(row, columns) for row in rows], axis=0)
    mass, length = fraction * float(body.sip.mass.sum()), float(np.linalg.norm(top - bottom))
    inertia = mass * length**2 * np.diag([sagittal**2, along**2, transverse**2])
    return parameters(Lump(mass, top + place * (bottom - top), inertia))


def shoulders(body: Body) -> Array | None:
    """Return the middle (3,) m between the shoulder joints in the trunk's frame; None for a body without them."""
    places = [joint.translation for joint in body.joints if joint.name.endswith("shoulder_flexion")]
    return np.mean(places, axis=0) if len(places) == 2 and "trunk_head" in body.segments else None
