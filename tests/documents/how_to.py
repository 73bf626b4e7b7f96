"""Pages of docs/how_to, run whole."""

from __future__ import annotations

from pathlib import Path

from tests.documents.blocks import blocks, script_of
from tests.documents.kinds import EXIT_CODES, WITH_AN_ARM
from tests.documents.shell import run_script


def faults_of(page: Path, folder: Path) -> list[str]:
    """What is not as the page says, once its commands have run; what it shows must be printed.

    Simulated runs are the same on every machine but for their dates.

    Args:
        page: Of docs/how_to.
        folder: Empty, to run in.
    """
    own = page.stem in WITH_AN_ARM
    code, out, err = run_script(script_of(page), folder, own_processes=own)
    faults = []
    if code != EXIT_CODES.get(page.stem, 0) or "Traceback" in err:
        faults.append(f"exit code {code}: {(out + err)[-2000:]}")
    shown = [own.text for own in blocks(page) if own.language == "text"]
    missing = [line for text in shown for line in text.splitlines() if line not in out]
    return faults + [f"not printed: {line}" for line in missing]
