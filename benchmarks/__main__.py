"""The one runner of all benchmarks.

    python -m benchmarks                      # what there is
    python -m benchmarks NAME --help          # its options
    python -m benchmarks NAME ...

It is called in the checkout. Real recordings are read from BIODANCE_DATA, the independent simulator from
BIODANCE_FOREIGN_LAB.
"""

import ast
import importlib
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent


def names() -> dict[str, str]:
    """Return the benchmarks, each with the first sentence of its file: every file here that has a ``main``."""
    found = {}
    for path in sorted(HERE.glob("[!_]*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        if any(isinstance(node, ast.FunctionDef) and node.name == "main" for node in tree.body):
            found[path.stem] = " ".join((ast.get_docstring(tree) or "").partition("\n\n")[0].split())
    return found


def main(words: list[str]) -> int:
    """Run a benchmark with its options; 2 where there is none of that name."""
    there = names()
    if not words or words[0] not in there:
        unknown = f"There is no benchmark {words[0]!r}.\n" if words and words[0] not in ("-h", "--help") else ""
        print(unknown + "\n".join(f"{name:20} {told}" for name, told in there.items()))
        return 2 if unknown else 0
    sys.path.insert(0, str(HERE.parent / "tests"))  # writers of sessions and faults, which tests and benchmarks share
    sys.argv = [f"python -m benchmarks {words[0]}", *words[1:]]
    return int(importlib.import_module(f"benchmarks.{words[0]}").main() or 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
