"""The list of all decisions, newest first in each topic, made from the dated records in docs/decisions/."""

import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import Files
from mkdocs.structure.pages import Page

FOLDER = Path(__file__).parents[1] / "decisions"
RECORD = re.compile(r"(\d{4}-\d{2}-\d{2})-[a-z0-9-]+\.md")
PLACE = "<!-- the list of all decisions -->"


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Put the records into the navigation, by topic."""
    entry = next(item for item in config.nav or () if "Decisions" in item)
    topics = [{topic: [f"decisions/{path.name}" for path in paths]} for topic, paths in by_topic(FOLDER).items()]
    entry["Decisions"] = ["decisions/README.md", *topics]
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Put the list into the page of the folder."""
    return markdown.replace(PLACE, contents(FOLDER)) if page.file.src_uri == "decisions/README.md" else markdown


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
    """Return the list as Markdown."""
    lines: list[str] = []
    for topic, paths in by_topic(folder).items():
        lines += ["", f"## {topic}", ""]
        lines += [
            f"- {path.name[:10]} [{path.read_text().splitlines()[0].removeprefix('# ')}]({path.name})" for path in paths
        ]
    return "\n".join(lines) + "\n"
