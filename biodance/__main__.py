"""``python -m biodance`` is the command ``biodance``."""

from biodance.cli import main

if __name__ == "__main__":
    main()
