"""One step at a time: what the data cannot carry is written down, and the next step goes on."""

import logging
from collections.abc import Callable
from typing import TypeVar

from biodance.errors import BiodanceError
from biodance.pipeline.results import Step

T = TypeVar("T")

log = logging.getLogger(__name__)


def attempt(steps: list[Step], name: str, work: Callable[[], T]) -> T | None:
    """Do ``work``, append what became of it to ``steps`` and return its result; None where it was refused or failed.

    A `BiodanceError` is a refusal: the data cannot carry this step. Any other exception is a fault of biodance: it is named as such, its
    traceback goes to the log (level debug), and the remaining steps are done all the same.
    """
    try:
        value = work()
    except BiodanceError as error:
        steps.append(Step(name, "refused", str(error)))
        return None
    except Exception as error:
        log.debug("step %s failed", name, exc_info=True)
        fault = f"biodance itself failed in the step {name} ({type(error).__name__}: {error}); the rest was done. Please report this."
        steps.append(Step(name, "failed", fault))
        return None
    steps.append(Step(name, "done"))
    return value
