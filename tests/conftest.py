"""What every test may count on: the front door is loaded before a test replaces a function that it imports, which it
would keep.
"""

import biodance.pipeline.front  # noqa: F401
