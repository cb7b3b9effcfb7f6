"""``python -m biodance`` is the command ``biodance``."""

import os
import sys

if __name__ == "__main__":
    if not sys.flags.safe_path and sys.path[0] != os.path.dirname(os.path.dirname(os.path.abspath(__file__))):
        del sys.path[0]  # Python puts the working folder there, whatever lies in it
    from biodance.cli import main

    main()
