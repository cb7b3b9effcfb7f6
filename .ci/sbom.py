"""Print the bill of materials of locked.txt as CycloneDX 1.6 JSON: name, version, package URL and the hashes of all
files that may be installed; the same file gives the same characters.

    python .ci/sbom.py > sbom.cdx.json
"""

import json
import re
import sys
import tomllib
import uuid
from pathlib import Path

ROOT = Path(__file__).parents[1]
_PINNED = re.compile(r"^(?P<name>[A-Za-z0-9._-]+)==(?P<version>[^\s;\\]+)(?: *; *(?P<marker>[^\\\n]+?))? *\\?$")


def normal(name: str) -> str:
    """Return a package's name as the index writes it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def locked(text: str) -> dict[str, tuple[str, str, list[str]]]:
    """Return version, marker and SHA-256 hashes of every package of a lock file by its name."""
    found: dict[str, tuple[str, str, list[str]]] = {}
    name = ""
    for line in text.splitlines():
        if pinned := _PINNED.match(line):
            name = normal(pinned["name"])
            found[name] = (pinned["version"], pinned["marker"] or "", [])
        elif "--hash=sha256:" in line:
            found[name][2].append(line.partition("--hash=sha256:")[2].split()[0])
    return found


def document(packages: dict[str, tuple[str, str, list[str]]], direct: set[str], version: str) -> dict[str, object]:
    """Return the bill; a package that biodance itself names is ``required``, every other one is so where its own needs
    say.
    """
    components = []
    for name, (pinned, marker, hashes) in sorted(packages.items()):
        url = f"pkg:pypi/{name}@{pinned}"
        files = {"type": "distribution", "url": f"https://pypi.org/project/{name}/{pinned}/#files"}
        one: dict[str, object] = {"type": "library", "bom-ref": url, "name": name, "version": pinned, "purl": url}
        one["externalReferences"] = [{**files, "hashes": [{"alg": "SHA-256", "content": h} for h in hashes]}]
        if name in direct:
            one["scope"] = "required"
        if marker:
            one["properties"] = [{"name": "python:marker", "value": marker}]
        components.append(one)
    about = {"type": "application", "bom-ref": "biodance", "name": "biodance", "version": version}
    number = uuid.uuid5(uuid.NAMESPACE_URL, json.dumps([version, components], sort_keys=True))
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": f"urn:uuid:{number}",
        "version": 1,
        "metadata": {"component": about},
        "components": components,
        "dependencies": [{"ref": "biodance", "dependsOn": sorted(str(c["bom-ref"]) for c in components)}],
    }


def main() -> None:
    """Print the bill."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    direct = {normal(re.split(r"[<>=\[;~! ]", one)[0]) for one in project["dependencies"]}
    version = re.search(r'__version__ = "([^"]+)"', (ROOT / "biodance" / "version.py").read_text())
    bill = document(locked((ROOT / "locked.txt").read_text()), direct, version[1] if version else "")
    sys.stdout.write(json.dumps(bill, indent=1) + "\n")


if __name__ == "__main__":
    main()
