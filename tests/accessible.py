"""axe-core asked about a page in a browser, and how wide the page gets. axe-core (MPL-2.0) comes with the tools that
build the bundle (web/package-lock.json); it is shipped with nothing.
"""

from pathlib import Path

import pytest
from browser import BROWSER, Page

_AXE = Path(__file__).parents[1] / "web" / "node_modules" / "axe-core" / "axe.min.js"
ASKED = pytest.mark.skipif(
    not (BROWSER and _AXE.is_file()), reason="no Chromium, or `make bundle` could not reach npm for axe-core"
)
SCREENS = {1280: 900, 390: 844}
"""Width and height in CSS pixels: a desk and a phone."""
_VIOLATIONS = """axe.run(document.querySelector('%s')).then(found => found.violations.map(
  one => `${one.id}: ${one.help}, ${one.nodes.length} times, first ${one.nodes[0].html.slice(0, 150)}`))"""
_WIDER = """(width => [...document.querySelectorAll('html, body *')].filter(one => one.getClientRects().length
  && Math.max(one.getBoundingClientRect().right, one.tagName === 'HTML' && one.scrollWidth) > width + 1).map(
  one => `wider than ${width} px: ${one.outerHTML.slice(0, 150)}`).slice(0, 5))"""


def unfold(browser: Page, address: str) -> None:
    """Load a page with all its parts unfolded."""
    browser.open(address)
    browser.run("document.querySelectorAll('details').forEach(one => one.open = true)")


def complaints(browser: Page, part: str = "html") -> list[str]:
    """Return what axe-core finds on a ``part`` (CSS) of the page that is loaded, and what of all is wider than a
    screen.
    """
    browser.run(f"{_AXE.read_text(encoding='utf-8')};0")
    found = []
    for width, height in SCREENS.items():
        browser.send(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )
        found += [f"{width} px: {one}" for one in browser.run(_VIOLATIONS % part) + browser.run(f"{_WIDER}({width})")]
    return found
