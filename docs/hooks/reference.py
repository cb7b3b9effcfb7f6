"""The page of the API reference: one entry for each public name of the front door, and one for each contract of a family.

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
    names = sorted((n for n in getattr(biodance, "__all__", ()) if not n.startswith("_")), key=str.lower)
    found = {name: getattr(biodance, name) for name in names}
    functions = [entry(name, thing) for name, thing in found.items() if inspect.isfunction(thing)]
    records = [entry(name, thing) for name, thing in found.items() if inspect.isclass(thing)]
    contracts = [entry(name, thing) for module, name in CONTRACTS if (thing := contract(module, name)) is not None]
    return "\n".join([START, "## Functions", "", *functions, "## Records", "", *records, FAMILIES, *contracts])


def contract(module: str, name: str) -> Any:
    """Return the contract of a family, None where this version has no such family yet."""
    try:
        return getattr(importlib.import_module(module), name, None)
    except ModuleNotFoundError:
        return None


def entry(name: str, thing: Any) -> str:
    """Return what tells mkdocstrings to write about one name: under its public name, from the module that defines it."""
    return f"::: {thing.__module__}.{thing.__qualname__}\n    options:\n      heading: {name}\n"
