"""What a page looks like, as numbers: what overlaps, what sticks out, where the first figure is."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from html import unescape
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from tests.reporting.browsing import browse

DARK = "--blink-settings=preferredColorScheme=0"
HERE = Path(__file__).resolve().parent


@dataclass(frozen=True)
class Looked:
    """What a browser says of a page that it has drawn.

    Attributes:
        scrolls: By how much it is wider than the window [px].
        first_figure: Where the first figure begins below the top [px]; None without any.
        overlaps: Pairs of labels within a figure that cover one another.
        cut: Labels that a figure's edge cuts.
        dark: Whether it took the colours of a dark scheme.
        serious: Rules of accessibility that it breaks, by axe-core, serious or worse; None where
            that was not asked.
    """

    scrolls: float
    first_figure: float | None
    overlaps: list[str]
    cut: list[str]
    dark: bool
    serious: list[str] | None

    @property
    def faults(self) -> list[str]:
        """All that should not be, in words."""
        found = [f"overlap: {pair}" for pair in self.overlaps] + [f"cut: {c}" for c in self.cut]
        found += [f"axe: {rule}" for rule in self.serious or []]
        found += [f"scrolls sideways by {self.scrolls:.0f} px"] if self.scrolls > 0 else []
        return found


def axe_source() -> str | None:
    """The script of axe-core that a package carries; None where it is not installed."""
    package = find_spec("axe_core_python")
    if package is None or package.origin is None:
        return None
    return (Path(package.origin).parent / "axe.min.js").read_text(encoding="utf-8")


def look(page: Path, folder: Path, width: int, *flags: str, axe: str | None = None) -> Looked:
    """Have a browser measure a page once it is drawn; complaints of the console are an error.

    Args:
        page: The file.
        folder: For a copy with the measuring script in it.
        width: Of the window [px].
        flags: Further ones of the browser, such as `DARK`.
        axe: The source of axe-core, where its rules are asked, too.
    """
    text = page.read_text(encoding="utf-8")
    scripts = [] if axe is None else [axe]
    scripts.append((HERE / "looking.js").read_text(encoding="utf-8"))
    added = "".join(f"<script>{script}</script>" for script in scripts)
    copy = folder / f"looked_{width}.html"
    copy.write_text(text.replace("</body>", f"{added}</body>"), encoding="utf-8")
    dom = browse(copy, folder / "profile", f"--window-size={width},1000", *flags, "--dump-dom")
    copy.unlink()
    found = re.search(r'<pre id="looked">(.*?)</pre>', dom, re.DOTALL)
    assert found is not None, f"{page} was never drawn: {dom[-400:]}"
    told: dict[str, Any] = json.loads(unescape(found[1]))
    return Looked(**told)


def picture(page: Path, file: Path, folder: Path, size: tuple[int, int], *flags: str) -> np.ndarray:
    """A screenshot, shape (height, width, 3)."""
    window = f"--window-size={size[0]},{size[1]}"
    browse(page, folder / "profile", window, *flags, f"--screenshot={file}")
    return np.asarray(Image.open(file).convert("RGB"))


def is_blank(pixels: np.ndarray) -> bool:
    """Whether nearly all of a picture is of one colour."""
    flat = pixels.reshape(-1, 3)
    values, counts = np.unique(flat[:: max(len(flat) // 200_000, 1)], axis=0, return_counts=True)
    return len(values) < 20 or counts.max() > 0.995 * counts.sum()


def printed_pages(page: Path, file: Path, folder: Path) -> int:
    """How many sheets a page takes."""
    browse(page, folder / "profile", "--no-pdf-header-footer", f"--print-to-pdf={file}")
    return len(re.findall(rb"/Type\s*/Page\b(?!s)", file.read_bytes()))
