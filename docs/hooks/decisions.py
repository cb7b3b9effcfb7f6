"""The index of the decision records, by topic, newest first: in the navigation and in docs/decisions/README.md.

After a record is added or its title changes, ``python docs/hooks/decisions.py`` writes the index anew.
"""

import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import Files

FOLDER = Path(__file__).parents[1] / "decisions"
RECORD = re.compile(r"(\d{4}-\d{2}-\d{2})-[a-z0-9-]+\.md")
START, END = "<!-- index: made by docs/hooks/decisions.py -->", "<!-- end of the index -->"


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Put the records into the navigation, by topic."""
    entry = next(item for item in config.nav or () if "Decisions" in item)
    topics = [{topic: [f"decisions/{path.name}" for path in paths]} for topic, paths in by_topic(FOLDER).items()]
    entry["Decisions"] = ["decisions/README.md", *topics]
    return files


def by_topic(folder: Path) -> dict[str, list[Path]]:
    """Return the records of every topic, newest first."""
    topics: dict[str, list[Path]] = {}
    for path in sorted(
        (p for p in folder.glob("*.md") if RECORD.fullmatch(p.name)), key=lambda p: p.name, reverse=True
    ):
        topic = next(
            line.partition(":")[2].strip() for line in path.read_text().splitlines() if line.startswith("Topic:")
        )
        topics.setdefault(topic, []).append(path)
    return dict(sorted(topics.items()))


def contents(folder: Path) -> str:
    """Return the index as Markdown."""
    lines: list[str] = []
    for topic, paths in by_topic(folder).items():
        lines += ["", f"## {topic}", ""]
        lines += [f"- [{path.read_text().splitlines()[0].removeprefix('# ')}]({path.name})" for path in paths]
    return "\n".join(lines) + "\n"


def indexed(page: str, folder: Path) -> str:
    """Return the page of the folder with its index made anew."""
    before, rest = page.split(START)
    return f"{before}{START}\n{contents(folder)}\n{END}{rest.split(END)[1]}"


if __name__ == "__main__":
    readme = FOLDER / "README.md"
    readme.write_text(indexed(readme.read_text(), FOLDER))
