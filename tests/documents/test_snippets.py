"""YAML of the documents is read by what reads it of a user: whole files are valid, and parts are
valid values of the keys that they show.
"""

from __future__ import annotations

from typing import Any

import pytest
import yaml
from pydantic import BaseModel, TypeAdapter

from testbench.drivers.imus.line_format import LineFormat
from testbench.emulation.ur.faults import UrScenario
from testbench.formats.mapping import MappingSpec
from testbench.records.specs.arm_calibration import ArmCalibration
from testbench.records.specs.band import Band
from testbench.records.specs.laboratory import Laboratory
from testbench.records.specs.protocol import ProtocolSpec
from testbench.records.specs.robot import RobotSpec
from tests.documents.blocks import Block, blocks, documents

ALL = [own for page in documents() for own in blocks(page) if own.language == "yaml"]
WHOLE: dict[str, type[BaseModel]] = {
    "README.md": ProtocolSpec,
    "docs/certificates.md": Laboratory,
    "docs/devices.md": LineFormat,
    "docs/emulator.md": UrScenario,
    "docs/formats.md": MappingSpec,
    "docs/real_arm.md": ArmCalibration,
    "docs/reports.md": Band,
}
"""What the blocks of a document are, where they are no part of a protocol or of a robot's file."""


@pytest.mark.parametrize("block", ALL, ids=lambda own: f"{own.document}:{own.line}")
def test_a_snippet_is_read(block: Block) -> None:
    content: dict[str, Any] = yaml.safe_load(block.text)
    whole = WHOLE.get(block.document, ProtocolSpec if "name" in content else None)
    if whole is not None:
        whole.model_validate(content)
        return
    for key, value in content.items():
        owner = ProtocolSpec if key in ProtocolSpec.model_fields else RobotSpec
        TypeAdapter(owner.model_fields[key].annotation).validate_python(value)
