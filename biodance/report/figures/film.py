"""The film of a dance played in MuJoCo: the body on its own feet beside the plan, from the right and from the front, as
.gif, or as .mp4 where the program ffmpeg is installed.
"""

import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from biodance.body.body import Body
from biodance.dance.rehearsal import Rehearsal
from biodance.errors import BiodanceError, MissingLibrary
from biodance.lab.plain_text import whole_file
from biodance.motion.kinematics import poses
from biodance.pipeline.still import bone_lines
from biodance.records import Array
from biodance.report.files import refuse_file

if TYPE_CHECKING:
    from PIL.Image import Image

_RATE = 12.5
"""Pictures per second."""
_SIZE, _FLOOR = (420, 480), 440
"""Of one view, px; row of the floor."""
_SCALE = 190.0
"""px per metre."""
_VIEWS = ((0, 1.0, "from the right"), (1, 1.0, "from the front"))
"""Lab axis to the right of the picture, its sign, and the title of each view."""
_INK = {"planned": (190, 190, 190), "right": (0, 114, 178), "left": (213, 94, 0), "middle": (60, 60, 60)}
_FORMATS = (".gif", ".mp4")


def film_path(out: Path, *, force: bool = False) -> Path:
    """Return the path of a film that can be written.

    Raises
    ------
    BiodanceError
        The name ends otherwise than .gif or .mp4, or the file exists and ``force`` was not given.
    MissingLibrary
        An .mp4 is asked for and ffmpeg is not installed.
    """
    if out.suffix.lower() not in _FORMATS:
        raise BiodanceError(f"{out}: a film ends in {' or '.join(_FORMATS)}. Choose another --out.")
    if out.suffix.lower() == ".mp4" and shutil.which("ffmpeg") is None:
        raise MissingLibrary(f"{out}: an .mp4 needs the program ffmpeg, which is not installed. Choose a .gif.")
    refuse_file(out, force=force)
    return out


def write_film(found: Rehearsal, out: Path) -> Path:
    """Write the film of a rehearsal and return its path (see `film_path`)."""
    played, body = found.playback, found.dance.body
    rows = np.arange(0, len(played.q), max(1, round(played.wrench.rate / _RATE)))
    plan = found.dance.motion(played.wrench.rate).q[rows]
    cop = played.wrench.cop()[rows]
    frames = [
        _picture(body, planned, real, point, float(t))
        for planned, real, point, t in zip(plan, played.q[rows], cop, played.time[rows], strict=True)
    ]
    with whole_file(out, over=True) as part:
        _write(frames, part, out)
    return out


def _write(frames: "list[Image]", part: Path, out: Path) -> None:
    """Write pictures as the film ``out`` under the name ``part``."""
    if out.suffix.lower() == ".gif":
        small = [frame.quantize(16) for frame in frames]
        small[0].save(part, save_all=True, append_images=small[1:], duration=round(1000 / _RATE), loop=0)
        return
    words = ["ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]
    words += ["-s", f"{2 * _SIZE[0]}x{_SIZE[1]}", "-r", str(_RATE), "-i", "-", "-pix_fmt", "yuv420p", str(part)]
    done = subprocess.run(words, input=b"".join(frame.tobytes() for frame in frames), capture_output=True, check=False)
    if done.returncode:
        raise BiodanceError(f"{out}: ffmpeg could not write it ({done.stderr.decode(errors='replace').strip()[:200]}).")


def _picture(body: Body, planned: Array, played: Array, cop: Array, time: float) -> "Image":
    """Return both views of one instant: the plan in grey, the played body in colour, the centre of pressure in red."""
    from PIL import Image, ImageDraw

    image = Image.new("RGB", (2 * _SIZE[0], _SIZE[1]), "white")
    draw = ImageDraw.Draw(image)
    draw.text((10, 8), f"{time:5.1f} s", fill="black")
    for number, (axis, sign, title) in enumerate(_VIEWS):
        left = number * _SIZE[0]
        draw.text((left + 10, 24), title, fill="black")
        draw.line([(left + 10, _FLOOR), (left + _SIZE[0] - 10, _FLOOR)], fill=(120, 120, 120), width=2)

        def at(point: Array, *, left: int = left, axis: int = axis, sign: float = sign) -> tuple[float, float]:
            return left + _SIZE[0] / 2 + sign * _SCALE * float(point[axis]), _FLOOR - _SCALE * float(point[2])

        for q, real in ((planned, False), (played, True)):
            lines, sides = bone_lines(body, poses(body, q))
            for (a, b), side in zip(lines[0], sides, strict=True):
                draw.line([at(a), at(b)], fill=_INK[side if real else "planned"], width=4 if real else 7)
        if np.isfinite(cop).all():
            x, y = at(cop)
            draw.ellipse([x - 5, y - 5, x + 5, y + 5], fill=(204, 0, 0))
    return image
