"""The tutorial pages: each is one script of examples/, with what it says, what it printed and what it drew.

`python docs/hooks/tutorials.py` runs the scripts and keeps their output in docs/tutorials/ (`make tutorials`).
"""

import ast
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "docs" / "tutorials"


def scripts() -> list[Path]:
    """Return the examples in their order."""
    return sorted((ROOT / "examples").glob("[0-9][0-9]_*.py"))


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Add a page for each script, and one that lists them."""
    files.append(File.generated(config, "tutorials/index.md", content=contents()))
    for script in scripts():
        files.append(File.generated(config, f"tutorials/{script.stem}.md", content=page(script)))
    entry = next(item for item in config.nav or () if "Tutorials" in item)
    entry["Tutorials"] = [
        "tutorials/index.md",
        *({short(script): f"tutorials/{script.stem}.md"} for script in scripts()),
    ]
    return files


def contents() -> str:
    """Return the page that lists the tutorials."""
    lines = [f"- [{title(script)}]({script.stem}.md)" for script in scripts()]
    said = "Each tutorial is one script of the folder `examples/`. It runs as it stands; the tests run it, too."
    return "\n".join(["# Tutorials", "", said, "", *lines, ""])


def page(script: Path) -> str:
    """Return the page of one script."""
    told, code = parts(script)
    lines = [f"# {title(script)}", told, "```python", code, "```", "", f"Run it: `python examples/{script.name}`"]
    printed, drawn = KEPT / f"{script.stem}.txt", KEPT / f"{script.stem}.png"
    if printed.is_file():
        lines += ["", "It prints:", "", "```text", printed.read_text(), "```"]
    if drawn.is_file():
        lines += ["", "It draws:", "", f"![What this script draws]({drawn.name})"]
    return "\n".join(lines) + "\n"


def parts(script: Path) -> tuple[str, str]:
    """Return what a script says about itself after its first line, and its code without that."""
    source = script.read_text()
    tree = ast.parse(source)
    told = [line for line in (ast.get_docstring(tree) or "").splitlines()[1:] if not line.startswith("python ")]
    return "\n".join(told).strip() + "\n", "\n".join(source.splitlines()[tree.body[0].end_lineno :]).strip()


def title(script: Path) -> str:
    """Return the first sentence of a script's docstring, with its number."""
    first = (ast.get_docstring(ast.parse(script.read_text())) or script.stem).splitlines()[0]
    return f"{script.stem[:2]} {first.rstrip('.')}"


def short(script: Path) -> str:
    """Return the name of a script as the navigation shows it."""
    return f"{script.stem[:2]} {script.stem[3:].replace('_', ' ').capitalize()}"


def run(script: Path) -> None:
    """Run one script; keep what it prints and draws, unless that shows a recording of a real person."""
    if "BIODANCE_DATA" in script.read_text():
        return
    KEPT.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        place = {**os.environ, "TMPDIR": scratch}  # where a figure without a name goes
        done = subprocess.run([sys.executable, script], env=place, capture_output=True, text=True, check=True)
        shutil.move(Path(scratch) / f"{script.stem}.png", KEPT / f"{script.stem}.png")
    (KEPT / f"{script.stem}.txt").write_text(done.stdout)


if __name__ == "__main__":
    for one in [path for path in scripts() if not sys.argv[1:] or path.stem in sys.argv[1:]]:
        run(one)
