"""Faults made in the raw recording (analog samples, corners, trajectories, labels, typed measures) without the formulas
of ``effects``: what is hidden in a file must not be made by the formula that finds it. A plate's fault speaks about its
wrench on the subject about the plate's centre in lab axes, reached through the plate's own decoding. ``clock`` says
from and to where in the session (0 to 1) every trial lies.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial, wraps
from typing import Any

import numpy as np

from biodance.errors import BiodanceError, UnknownName, known_index, refuse_unknown
from biodance.lab.c3d.write import PlateRecording
from biodance.records import CHANNELS, Array, Markers
from biodance.virtual_lab.instruments import HALF_SIZE
from biodance.virtual_lab.person.skeleton import stream
from biodance.virtual_lab.visit import Fault, Recording

Builder = Callable[..., Fault]
"""Returns the fault of a ``target``; the sizes of the fault are its keywords, SI units."""
Clock = dict[str, tuple[float, float]]


@dataclass(frozen=True, eq=False)
class Channel:
    """One channel of a plate in one trial: its ``load`` (S,) N or N·m at ``rate`` Hz; ``force`` or else a moment."""

    load: Array
    rate: float
    trial: str
    force: bool


def decoding(plate: PlateRecording) -> Array:
    """Return D (6, 6): wrench on the subject about the plate's centre in lab axes = D @ channels, for TYPE 2 and 4."""
    first, second, _, fourth = plate.corners
    # From corners 2 and 4 to 1: plate x and y.
    x = (first - second) / np.linalg.norm(first - second)
    z = np.cross(x, first - fourth)
    z /= np.linalg.norm(z)
    turn = np.stack([x, np.cross(z, x), z], axis=1)
    ox, oy, oz = plate.origin
    to_surface = np.eye(6)
    # M_surface = M - origin x F.
    to_surface[3:, :3] = -np.array([[0, -oz, oy], [oz, 0, -ox], [-oy, ox, 0]])
    loads = np.eye(6) if plate.calibration is None else plate.calibration
    # Block diagonal: force and moment turn alike.
    return np.kron(np.eye(2), turn) @ to_surface @ loads


FAULTS: dict[str, Builder] = {}
"""Every fault made here, by its name."""


def made_here(build: Builder) -> Builder:
    """Add a fault to those that are known by name."""
    FAULTS[build.__name__] = build
    return build


def on_recording(change: Callable[..., Recording]) -> Builder:
    """Build faults of a whole recording from ``change`` (recording, target, **sizes) -> Recording."""

    @wraps(change)
    def build(target: str, **sizes: Any) -> Fault:
        return partial(change, target=target, **sizes)

    return made_here(build)


def on_plate(change: Callable[..., Array]) -> Builder:
    """Build faults of one plate from ``change`` (wrench (S, 6), target, **sizes) -> (S, 6)."""

    @wraps(change)
    def build(target: str, **sizes: float) -> Fault:
        return _in_wrench(target, lambda wrench, _: change(wrench, target, **sizes))

    return made_here(build)


def on_channel(change: Callable[..., Array]) -> Builder:
    """Build faults of one channel of one plate from ``change`` (Channel, **sizes) -> (S,)."""

    @wraps(change)
    def build(target: str, **sizes: float) -> Fault:
        index = fault_channel(target)

        def changed(wrench: Array, recording: Recording) -> Array:
            out = wrench.copy()
            one = Channel(wrench[:, index], recording.analog_rate, recording.name, index < CHANNELS.index("Mx"))
            out[:, index] = change(one, **sizes)
            return out

        return _in_wrench(target, changed)

    return made_here(build)


def _in_wrench(target: str, change: Callable[[Array, Recording], Array]) -> Fault:
    """Return the fault that changes the wrench (S, 6) of the plate in the target (``plate2:Fz``), or of the first."""

    def fault(recording: Recording) -> Recording:
        plate = recording.plates[_plate_index(target, recording)]
        D = decoding(plate)
        # The wrench, changed, and back to what is stored.
        channels = change(plate.channels @ D.T, recording) @ np.linalg.inv(D).T
        return _with_plate(target, recording, replace(plate, channels=channels))

    return fault


def _plate_index(target: str, recording: Recording) -> int:
    name = target.partition(":")[0] if target.startswith("plate") else "plate1"
    legal = [f"plate{i + 1}" for i in range(len(recording.plates))]
    return known_index("force plate of the virtual laboratory", name, legal)


def _with_plate(target: str, recording: Recording, plate: PlateRecording) -> Recording:
    index = _plate_index(target, recording)
    return replace(recording, plates=(*recording.plates[:index], plate, *recording.plates[index + 1 :]))


def fault_channel(target: str) -> int:
    """Return the place 0..5 of the channel that a target names last; UnknownName lists the channels."""
    name = target.rpartition(":")[2]
    return known_index("channel of a force plate", name, CHANNELS)


def axis_index(target: str) -> int:
    """Return 0, 1, 2 for a target that ends with x, y, z; UnknownName otherwise."""
    refuse_unknown("axis", target[-1:], ("x", "y", "z"))
    return "xyz".index(target[-1])


@on_channel
def plate_offset(channel: Channel, offset: float) -> Array:
    """Add a constant ``offset`` (N or N·m)."""
    return channel.load + offset


@on_channel
def plate_gain(channel: Channel, gain: float) -> Array:
    """Read ``gain`` (0.04 = 4 %) too much."""
    return channel.load * (1.0 + gain)


@on_plate
def plate_crosstalk(wrench: Array, target: str, ratio: float) -> Array:
    """Let ``ratio`` of the first channel show in the second; target ``Fz->My``."""
    first, _, second = target.rpartition(":")[2].partition("->")
    mixing = np.eye(6)
    mixing[fault_channel(second), fault_channel(first)] += ratio
    return wrench @ mixing.T


@on_channel
def plate_drift(channel: Channel, drift: float, clock: Clock) -> Array:
    """Let the zero wander by ``drift`` over the session."""
    # Zero in the middle of the session.
    return channel.load + drift * (np.linspace(*clock[channel.trial], len(channel.load)) - 0.5)


@on_channel
def axis_error(channel: Channel) -> Array:
    """Turn the sign."""
    return -channel.load


@on_channel
def clipping(channel: Channel, limit: float) -> Array:
    """Saturate at +-``limit`` (N or N·m)."""
    return np.clip(channel.load, -limit, limit)


@on_channel
def mains_hum(channel: Channel, amplitude: float) -> Array:
    """Add a 50 Hz sine of ``amplitude`` (N or N·m)."""
    return channel.load + np.sin(2 * np.pi * 50 * np.arange(len(channel.load)) / channel.rate) * amplitude


@on_channel
def plate_hysteresis(channel: Channel, width: float) -> Array:
    """Follow the load in a loop of half ``width`` (N or N·m): part of it passes through joints with play."""
    load, loops = channel.load, []
    # Half the play of each joint of the plate: N, of a moment a third as many N·m.
    for slack in np.array((10.0, 20.0, 40.0)) * (1.0 if channel.force else 0.33):
        # a joint with play moves only when pushed by its slack
        through, place = np.empty_like(load), load[0]
        for k, value in enumerate(load):
            through[k] = place = min(max(place, value - slack), value + slack)
        loops.append((through - load) / slack)
    return load + width * np.mean(loops, axis=0)


@on_channel
def plate_creep(channel: Channel, ratio: float) -> Array:
    """Go on rising under load: ``ratio`` of the load of the last 4 s or so is added."""
    from scipy.signal import lfilter

    step = 1.0 / (4.0 * channel.rate)
    # First-order lag: y_k = y_(k-1) + step (x_k - y_(k-1)).
    return channel.load + ratio * lfilter([step], [1.0, step - 1.0], channel.load)


@on_channel
def loose_connection(channel: Channel, gain: float) -> Array:
    """Shake a bad plug: ``gain`` too much for some tenths of a second, about once in 3 s and at least once."""
    rng, out = stream(0, "loose connection", channel.trial), channel.load.copy()
    for _ in range(max(1, rng.poisson(len(out) / channel.rate / 3.0))):
        first = int(rng.integers(0, len(out)))
        out[first : first + int(rng.uniform(0.2, 0.8) * channel.rate)] *= 1.0 + gain
    return out


@on_channel
def saturating(channel: Channel, ratio: float) -> Array:
    """Read ``ratio`` less at 1000 N or 300 N·m, growing with the square of the load."""
    return channel.load * (1.0 - ratio * (channel.load / (1000.0 if channel.force else 300.0)) ** 2)


@on_plate
def plate_bending(wrench: Array, target: str, size: float) -> Array:
    """Bend the top plate: the centre of pressure errs with the square of its distance from the middle, by ``size``
    (m) at the long edge.
    """
    out = wrench.copy()
    safe = np.where(np.abs(wrench[:, 2]) > 20.0, wrench[:, 2], np.inf)
    x, y = -wrench[:, 4] / safe, wrench[:, 3] / safe
    far = (x**2 + y**2) / HALF_SIZE[1] ** 2
    # x = -My / Fz and y = Mx / Fz: the moments that move the pressure.
    out[:, 4] -= size * far * wrench[:, 2]
    out[:, 3] += 0.5 * size * far * wrench[:, 2]
    return out


@on_plate
def object_on_plate(wrench: Array, target: str, weight: float) -> Array:
    """Put something of ``weight`` (N) on a corner of the plate for the middle 40 % of every trial."""
    x, y = 0.7 * HALF_SIZE
    share = np.linspace(0.0, 1.0, len(wrench))
    on = ((share > 0.3) & (share < 0.7)).astype(float)
    # Moment of a vertical force at (x, y): (y, -x, 0) times it.
    return wrench + on[:, None] * weight * np.array([0.0, 0.0, 1.0, y, -x, 0.0])


@on_recording
def plate_position(recording: Recording, target: str, shift: float) -> Recording:
    """Let the file put a plate ``shift`` (m) beside where it lies; target ``plate1:x``, lab axes."""
    plate = recording.plates[_plate_index(target, recording)]
    corners = plate.corners + shift * np.eye(3)[axis_index(target)]
    return _with_plate(target, recording, replace(plate, corners=corners))


@on_recording
def plate_rotation(recording: Recording, target: str, angle: float) -> Recording:
    """Let the file turn a plate by ``angle`` (rad) about a lab axis through its centre; target ``plate1:z``."""
    from scipy.spatial.transform import Rotation

    plate = recording.plates[_plate_index(target, recording)]
    centre, turn = plate.corners.mean(axis=0), Rotation.from_rotvec(angle * np.eye(3)[axis_index(target)])
    return _with_plate(target, recording, replace(plate, corners=centre + turn.apply(plate.corners - centre)))


def _with_channels(recording: Recording, change: Callable[[Array], Array]) -> Recording:
    """Return the recording with the stored channels (S, 6) of every plate changed."""
    return replace(recording, plates=tuple(replace(p, channels=change(p.channels)) for p in recording.plates))


def _late(recording: Recording, delay: Array | float) -> Recording:
    """Return the recording with all forces late by ``delay`` s: one number, or one a sample."""

    def late(values: Array) -> Array:
        samples = np.arange(len(values)) / recording.analog_rate
        # Late: the sample at t was that of t - delay.
        return np.stack([np.interp(samples - delay, samples, column) for column in values.T], axis=1)

    return _with_channels(recording, late)


@on_recording
def time_delay(recording: Recording, target: str, delay: float) -> Recording:
    """Let all forces come ``delay`` (s) late."""
    return _late(recording, delay)


@on_recording
def clock_drift(recording: Recording, target: str, stretch: float, clock: Clock) -> Recording:
    """Let the forces fall behind by ``stretch`` (s) over the session, on time in its middle."""
    share = np.linspace(*clock[recording.name], len(recording.plates[0].channels))
    return _late(recording, stretch * (share - 0.5))


@on_recording
def trigger_jitter(recording: Recording, target: str, jitter: float) -> Recording:
    """Start the forces of every trial late by a standard deviation of ``jitter`` (s), drawn per trial."""
    return _late(recording, jitter * stream(3, "trigger", recording.name).normal())


@on_recording
def unit_error(recording: Recording, target: str, factor: float) -> Recording:
    """Store all channels ``factor`` times too large (4.448 for pounds taken for newtons, 1000 for mm taken for m)."""
    return _with_channels(recording, lambda channels: factor * channels)


@on_recording
def filter_mismatch(recording: Recording, target: str, cutoff: float) -> Recording:
    """Smooth all channels at ``cutoff`` Hz (second order, twice, without lag), as an amplifier may before storing."""
    from scipy.signal import butter, sosfiltfilt

    if not 0 < cutoff < recording.analog_rate / 2:
        raise BiodanceError(
            f"filter_mismatch: cutoff = {cutoff:g} Hz; legal: above 0 and below {recording.analog_rate / 2:g} Hz."
        )
    smooth = butter(2, cutoff, fs=recording.analog_rate, output="sos")
    return _with_channels(recording, lambda channels: sosfiltfilt(smooth, channels, axis=0))


@on_recording
def body_mass(recording: Recording, target: str, error: float) -> Recording:
    """Declare ``error`` (kg) less than the person weighs."""
    processing = dict(recording.parameters["PROCESSING"])
    processing["Bodymass"] = float(processing["Bodymass"]) - error  # type: ignore[arg-type]
    return replace(recording, parameters={**recording.parameters, "PROCESSING": processing})


@on_recording
def labels_swapped(recording: Recording, target: str) -> Recording:
    """Exchange the labels of two markers; target ``LKNE/RKNE``."""
    one, _, other = target.partition("/")
    markers, exchange = recording.markers, {one: other, other: one}
    for name in (one, other):
        if name not in markers:
            raise UnknownName.of("marker of the recording", name, markers.names)
    names = tuple(exchange.get(name, name) for name in markers.names)
    return replace(recording, markers=Markers(names, markers.time, markers.xyz))


@made_here
def frame_rate(target: str, ratio: float) -> Fault:
    """Declare the rates (cameras and force alike) ``ratio`` times what they were."""
    if not 0.1 < ratio < 10:
        raise BiodanceError(f"frame_rate: ratio = {ratio:g}; legal: between 0.1 and 10 (declared over true rate).")

    def fault(recording: Recording) -> Recording:
        markers = recording.markers
        slow = Markers(markers.names, markers.time / ratio, markers.xyz)
        return replace(recording, markers=slow, analog_rate=recording.analog_rate * ratio)

    return fault


@on_recording
def dropped_frames(recording: Recording, target: str, count: float) -> Recording:
    """Let the cameras lose ``count`` frames in a row in the middle of every trial, and not say so; the forces go on."""
    lost, markers, frames = round(count), recording.markers, recording.markers.time.size
    if not 0 < lost < frames // 4:
        raise BiodanceError(f"dropped_frames: count = {count:g}; legal: 1 to {frames // 4} frames of this recording.")
    kept = np.delete(np.arange(frames), np.arange(frames // 2, frames // 2 + lost))
    samples = kept.size * (len(recording.plates[0].channels) // frames)
    shorter = Markers(markers.names, markers.time[: kept.size], markers.xyz[kept])
    return replace(_with_channels(recording, lambda channels: channels[:samples]), markers=shorter)


@on_recording
def swaying_cameras(recording: Recording, target: str, sway: float) -> Recording:
    """Swing the frame of the cameras at 1.7 Hz with an amplitude of ``sway`` (m): all markers seem to move."""
    markers = recording.markers
    phase = 2 * np.pi * 1.7 * markers.time
    move = sway * np.stack([np.sin(phase), 0.6 * np.cos(phase), 0.0 * phase], axis=1)
    return replace(recording, markers=Markers(markers.names, markers.time, markers.xyz + move[:, None]))
