"""What every request is made of: records that compare by content and go through JSON unchanged."""

from __future__ import annotations

import hashlib
import json
import os
from typing import Annotated, Any

from pydantic import BeforeValidator, ConfigDict

from testbench.records.specs.strict import StrictModel


def _path(given: Any) -> Any:
    """A path as text; anything else as it is."""
    return os.fspath(given) if isinstance(given, os.PathLike) else given


Place = Annotated[str, BeforeValidator(_path)]
"""A file or folder, or a name that the bench finds one by; paths may be given as `Path`."""


class Asked(StrictModel):
    """A part of a request.

    Numbers are not judged here but where they are used, which says in its own words what is wrong
    with them.
    """

    model_config = ConfigDict(allow_inf_nan=True)

    def canonical(self) -> str:
        """As JSON, the same text for the same content."""
        return json.dumps(self.model_dump(mode="json"), sort_keys=True, separators=(",", ":"))

    @property
    def key(self) -> str:
        """SHA-256 of what is asked, hexadecimal.

        Files count by their names: who keeps results by it adds the hashes of the files.
        """
        return hashlib.sha256(self.canonical().encode()).hexdigest()

    def __hash__(self) -> int:
        return hash(self.canonical())
