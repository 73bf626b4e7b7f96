"""What a site of the documents needs beside docs/: README.md as its first page, and the files of
the repository that the documents link to, as they are.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parent.parent
SOURCE = "source"
"""Folder of the site for files from outside of docs/."""
LINK = re.compile(r"(\]\()([^()#\s]+)((?:#[^()\s]*)?\))")


def on_files(files: Files, config: Any) -> Files:
    """Add the first page, and each file that a document links to."""
    texts = {file.src_uri: file.content_string for file in files.documentation_pages()}
    texts["index.md"] = (ROOT / "README.md").read_text(encoding="utf-8")
    files.append(
        File.generated(config, "index.md", content=_rehung("README.md", texts["index.md"]))
    )
    for name, text in texts.items():
        place = "README.md" if name == "index.md" else f"docs/{name}"
        for _, target, _ in LINK.findall(text):
            path = _path(place, target)
            if path is None or path.startswith("docs/") or path == "README.md":
                continue
            uri = f"{SOURCE}/{path}"
            if (ROOT / path).is_file() and files.get_file_from_path(uri) is None:
                files.append(File.generated(config, uri, abs_src_path=str(ROOT / path)))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Bend links that lead out of docs/ to the copies in the site."""
    name = page.file.src_uri
    return markdown if name == "index.md" else _rehung(f"docs/{name}", markdown)


def _path(place: str, target: str) -> str | None:
    """Where a link of a document leads, from the root of the repository; None out of it."""
    if re.match(r"[a-z]+:", target):
        return None
    path = posixpath.normpath(posixpath.join(posixpath.dirname(place), target))
    return None if path.startswith("..") else path


def _rehung(place: str, text: str) -> str:
    """A document with the links that lead out of docs/ bent to the copies."""
    here = "." if place == "README.md" else posixpath.dirname(place.removeprefix("docs/"))

    def bent(found: re.Match[str]) -> str:
        path = _path(place, found[2])
        if path is None or (path.startswith("docs/") and place != "README.md"):
            return found[0]
        if path == "README.md":
            own = "index.md"
        else:
            own = path.removeprefix("docs/") if path.startswith("docs/") else f"{SOURCE}/{path}"
        return f"{found[1]}{posixpath.relpath(own, here or '.')}{found[3]}"

    return LINK.sub(bent, text)
