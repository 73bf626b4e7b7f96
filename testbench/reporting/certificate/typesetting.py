"""A certificate as PDF, set by typst from the very text of its JSON file; the one door to it."""

from __future__ import annotations

import hashlib
import importlib.util
from pathlib import Path
from tempfile import TemporaryDirectory

from testbench.exceptions import InputError
from testbench.extras import missing_extra
from testbench.records.results.certificate import Certificate
from testbench.records.specs.shipped import shipped_data

LAYOUT = shipped_data("reporting", "certificate") / "certificate.typ"
EXTRA = "certificate"
PACKAGES = ("typst", "matplotlib")


def refuse_missing() -> None:
    """Refuse to set a page where what sets it is not installed.

    Raises:
        InputError: Names the extra, and a command that brings it.
    """
    if any(importlib.util.find_spec(name) is None for name in PACKAGES):
        raise InputError(
            f"{missing_extra('the pages of a certificate need', EXTRA)}; without --pdf the JSON "
            "file alone is written"
        )


def pdf_of(certificate: Certificate, json_name: str) -> bytes:
    """The pages of a certificate.

    Args:
        certificate: What they say.
        json_name: Of the machine-readable file, which they refer to by its hash.
    """
    import typst

    with TemporaryDirectory(prefix="testbench_certificate_") as name:
        _fill(Path(name), certificate)
        return bytes(
            typst.compile(
                Path(name) / LAYOUT.name, root=Path(name), sys_inputs=_told(certificate, json_name)
            )
        )


def _fill(folder: Path, certificate: Certificate) -> None:
    """The layout, the content and the pictures."""
    from testbench.reporting.certificate.drawing import svg_of

    (folder / LAYOUT.name).write_bytes(LAYOUT.read_bytes())
    (folder / "certificate.json").write_text(certificate.text(), encoding="utf-8")
    for i, figure in enumerate(certificate.figures):
        (folder / f"figure_{i}.svg").write_bytes(svg_of(figure))


def _told(certificate: Certificate, json_name: str) -> dict[str, str]:
    digest = hashlib.sha256(certificate.text().encode()).hexdigest()
    return {"json_name": json_name, "json_sha256": digest}
