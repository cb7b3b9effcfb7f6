"""The list of all decisions, newest first, made from the dated records in docs/decisions/."""

import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

FOLDER = Path(__file__).parents[1] / "decisions"
RECORD = re.compile(r"(\d{4}-\d{2}-\d{2})-[a-z0-9-]+\.md")
START = """# Decisions

Each real decision is one short dated record: context, decision, measurement, consequences. A record is not changed later; a newer one
replaces it and says so. [How to add one](README.md).
"""


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Add the list to the site."""
    files.append(File.generated(config, "decisions/index.md", content=page(FOLDER)))
    return files


def page(folder: Path) -> str:
    """Return the list as Markdown, by topic."""
    topics: dict[str, list[str]] = {}
    for path in sorted((p for p in folder.glob("*.md") if RECORD.fullmatch(p.name)), reverse=True):
        lines = path.read_text().splitlines()
        topic = next(line.partition(":")[2].strip() for line in lines if line.startswith("Topic:"))
        topics.setdefault(topic, []).append(f"- {path.name[:10]} [{lines[0].removeprefix('# ')}]({path.name})")
    return "\n".join([START, *(line for topic in sorted(topics) for line in (f"\n## {topic}\n", *topics[topic]))]) + "\n"
