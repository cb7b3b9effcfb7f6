"""The page of the API reference: one entry for each public name of the front door, and one for each contract of a
family.

The names come from the package itself, so that the page cannot name what does not exist, nor forget what does.
"""

import importlib
import inspect
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

import biodance

PAGE = "reference/index.md"
START = """# API reference

Everything that a user's own script needs is in `import biodance`. Shapes and SI units stand in every entry.
"""
FAMILIES = """
## Contracts of the families

One member, one file. The [how-to pages](../howto/index.md) show how to write one.
"""
CONTRACTS = (
    ("biodance.effects", "Effect"),
    ("biodance.effects", "DiscreteEffect"),
    ("biodance.effects", "Parameter"),
    ("biodance.effects", "Case"),
    ("biodance.dance.limits", "Limit"),
    ("biodance.dance.limits", "Margins"),
    ("biodance.dance.limits", "CheckedMotion"),
    ("biodance.dance.limits", "Remaining"),
    ("biodance.lab.readers", "Reader"),
)


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Add the page to the site."""
    files.append(File.generated(config, PAGE, content=page()))
    return files


def page() -> str:
    """Return the page as Markdown."""
    found = {name: getattr(biodance, name) for name in sorted(biodance.__all__, key=str.lower)}
    functions = [entry(name, thing) for name, thing in found.items() if not inspect.isclass(thing)]
    errors = {name: thing for name, thing in found.items() if inspect.isclass(thing) and issubclass(thing, Exception)}
    records = [entry(name, thing) for name, thing in found.items() if inspect.isclass(thing) and name not in errors]
    refusals = [entry(name, thing) for name, thing in errors.items()]
    contracts = [entry(name, getattr(importlib.import_module(module), name)) for module, name in CONTRACTS]
    headed = {"Functions": functions, "Records": records, "Errors": refusals}
    parts = [line for head, entries in headed.items() for line in (f"## {head}", "", *entries)]
    return "\n".join([START, *parts, FAMILIES, *contracts])


def entry(name: str, thing: Any) -> str:
    """Return what tells mkdocstrings to write about one name: under its public name, from the module that defines
    it.
    """
    return f"::: {thing.__module__}.{thing.__qualname__}\n    options:\n      heading: {name}\n"
