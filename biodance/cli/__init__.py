"""The command ``biodance``: parse, call, print. Rooms are imported inside the commands, so that ``--help`` is quick.

Exit codes: 0 done, 1 done but something was refused or needs a person, 2 could not be done (one sentence on stderr),
130 stopped by Ctrl-C.
"""

import gc
import os
import sys
from collections.abc import Sequence

from cyclopts import CycloptsError, MissingArgumentError

from biodance.cli import archive, dance, files, session
from biodance.cli.shared import DONE, NOT_DONE, STOPPED, app, say

__all__ = ["app", "archive", "dance", "files", "main", "run", "session"]


def run(tokens: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; every expected fault is one sentence on stderr."""
    from biodance.errors import BiodanceError

    try:
        code = app(tokens, exit_on_error=False, print_error=False, result_action="return_value") or DONE
        sys.stdout.flush()
        return code
    except CycloptsError as error:
        say(f"{_misused(error)} See {' '.join(('biodance', *(error.command_chain or ())))} --help.")
    except BiodanceError as error:
        say(str(error))
    except BrokenPipeError:
        _onto_nothing(1)
        say("The output was closed before all was written to it. What went into files is complete.")
    except OSError as error:
        why = error.strerror or f"cannot be written ({error}). Is the disk full?"
        given = list(sys.argv[1:] if tokens is None else tokens)  # where to write to, if the fault does not tell
        at = given.index("--out") + 1 if "--out" in given else len(given)
        place = error.filename or (given[at] if at < len(given) else "biodance")
        say(f"{place}: {why.rstrip('.')}.")
    except Exception as error:
        if "BIODANCE_TRACEBACK" in os.environ:
            raise
        say(
            f"biodance itself failed ({type(error).__name__}: {error}). Please report this; BIODANCE_TRACEBACK=1 "
            f"shows where."
        )
    except KeyboardInterrupt:
        say("Stopped before the command was done; what was already written is complete.")
        return STOPPED
    return NOT_DONE


def _misused(error: CycloptsError) -> str:
    """Return in one sentence what is wrong with a command line."""
    if not isinstance(error, MissingArgumentError) or error.argument is None:
        return " ".join(str(error).split())
    one, says = error.argument, error.argument.parameter.help
    name = one.name if one.index is None else one.name.lstrip("-").upper()
    return f"{name} is missing{f': {says}' if says else '.'}"


def _onto_nothing(number: int) -> None:
    """Let input, output or errors (0, 1, 2) go to nowhere, so that nothing is raised of it any more."""
    nothing = os.open(os.devnull, os.O_RDWR)
    if nothing != number:
        os.dup2(nothing, number)
        os.close(nothing)
    for name in ("stdin", "stdout", "stderr")[number : number + 1]:
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "w" if number else "r", encoding="utf-8", closefd=False))


def main() -> None:
    """Run the command line and leave with its exit code.

    At the end the interpreter would look five times for circles among some 250,000 objects that go with the process
    anyway (0.4 s); frozen ones it passes over.
    """
    for number in (0, 1, 2):  # a closed one would be taken by the next file that is opened
        try:
            os.fstat(number)
        except OSError:
            _onto_nothing(number)
    gc.set_threshold(1_000_000)  # Python's own limit is 700: imports alone make 300,000 objects
    code = run()
    gc.freeze()
    sys.exit(code)
