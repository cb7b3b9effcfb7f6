"""Refuse, in a sentence and before anything is installed, what the disk has no room for. Used by the Makefile.

    python3 .ci/room.py FOLDER=GB [FOLDER=GB ...]

What lies on one disk is added up. Exit code 1, and the sentence on stderr, where a disk has less free.
"""

import shutil
import sys
from collections import defaultdict
from pathlib import Path


def disk(folder: str) -> Path:
    """Return the folder, or of one that is yet to be made the nearest above it that is there."""
    path = Path(folder).absolute()
    return next(place for place in (path, *path.parents) if place.is_dir())


def main(wanted: list[str]) -> int:
    """Say of every disk that has not the room what it lacks; return the exit code."""
    needs: dict[int, list[tuple[str, float]]] = defaultdict(list)
    for text in wanted:
        folder, _, gigabytes = text.rpartition("=")
        needs[disk(folder).stat().st_dev].append((folder, float(gigabytes)))
    status = 0
    for parts in needs.values():
        need = sum(gigabytes for _, gigabytes in parts)
        room = shutil.disk_usage(disk(parts[0][0]))
        if room.total and room.free < 1e9 * need:
            where = " and ".join(f"{gigabytes:g} GB in {folder}" for folder, gigabytes in parts)
            sys.stderr.write(
                f"The disk is too full to install biodance: it needs {where}, and {room.free / 1e9:.1f} GB are free. "
                "Make room, or let TMPDIR name a folder on another disk; `make ROOM=no ...` tries all the same.\n"
            )
            status = 1
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
