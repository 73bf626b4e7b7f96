"""The documents become a site without a warning, whose links lead to what is there."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote

import pytest

from tests.documents.blocks import ROOT, documents
from tests.patience import PATIENCE_S

needs_mkdocs = pytest.mark.skipif(
    importlib.util.find_spec("material") is None, reason="mkdocs-material is not installed"
)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)],
        cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE_S,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "WARNING" not in done.stdout + done.stderr
    return folder


@needs_mkdocs
def test_every_document_is_a_page(site: Path) -> None:
    names = {page.relative_to(ROOT / "docs") for page in documents() if "docs" in page.parts}
    pages = {
        name.parent / "index.html" if name.name == "README.md" else name.with_suffix(".html")
        for name in names
    }
    assert (site / "index.html").is_file()
    assert [str(page) for page in pages if not (site / page).is_file()] == []


@needs_mkdocs
def test_links_of_the_site_lead_somewhere_and_nothing_is_loaded_from_elsewhere(site: Path) -> None:
    broken, loaded = [], []
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        loaded += re.findall(r"<(?:script|img|link)[^>]+(?:src|href)=\"(https?://[^\"]+)", text)
        for target in re.findall(r"(?:src|href)=\"([^\"#]+)", text):
            if page.name != "404.html" and not re.match(r"[a-z]+:", target):
                file = (page.parent / unquote(target)).resolve()
                broken += [] if file.exists() else [f"{page.relative_to(site)}: {target}"]
    assert broken == []
    assert loaded == []
