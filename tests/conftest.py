"""What every test may count on: the front door is loaded before a test replaces a function that it imports, which it
would keep; the folder with real recordings.
"""

import os
from pathlib import Path

import pytest

import biodance.pipeline.front  # noqa: F401


@pytest.fixture(scope="session")
def data() -> Path:
    """Return the folder with real recordings of other laboratories; skips the test where there is none."""
    folder = os.environ.get("BIODANCE_DATA")
    if not folder:
        pytest.skip("BIODANCE_DATA does not name the folder with real recordings")
    return Path(folder)
