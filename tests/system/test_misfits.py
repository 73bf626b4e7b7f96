"""What calibrations of whole sessions say of errors that their models have not: a few parts of the
campaign `lack_of_fit`, and where it is said.
"""

from __future__ import annotations

import json

import pytest

from testbench.estimation.calibration.session_calibration import calibrate as calibrate_sensor
from testbench.estimation.calibration.stored_calibration import StoredCalibrations
from testbench.records.results.calibration_file import load_calibration
from tests.command_line import command
from tests.system.misfits import LACKS, SENSOR, clean, named, session

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("lack", LACKS, ids=lambda lack: f"{lack.kind} {lack.triad}")
def test_the_largest_size_of_each_is_named(lack):
    told, others = named(lack, lack.sizes[-1], seed=0)
    assert told and not others, others


def test_of_a_part_that_lacks_nothing_nothing_is_said():
    parts = [clean(seed) for seed in range(2)]
    assert not [part["codes"] for part in parts if part["codes"]]
    for triad in ("accelerometer", "gyroscope"):
        assert 0.2 < sum(part["chi_square"][triad] for part in parts) / len(parts) < 1.6


def test_terminal_file_report_and_later_sessions_say_the_same(tmp_path, capsys):
    warming = LACKS[0]
    with session(warming.kind, warming.sizes[-1], 1) as recorded:
        result = calibrate_sensor(recorded, SENSOR)
        first = next(own for own in result.calibration.findings if own.code == warming.code)
        file = tmp_path / "sensor.yaml"
        assert command("calibrate", recorded.path, "--out", file) == 0
        said = " ".join(capsys.readouterr().out.split())
        assert f"warning: {first}" in said
        stored = load_calibration(file)
        assert stored.findings == result.calibration.findings
        page = file.with_suffix(".html").read_text(encoding="utf-8")
        assert "Where its model ends" in page and first.remedy in page
        (warned,) = [
            own
            for own in StoredCalibrations.among([stored], recorded).findings(SENSOR)
            if own.code == "calibration.stored_warning"
        ]
        assert first.sentence in warned.sentence
        other = tmp_path / "other.yaml"
        assert command("calibrate", recorded.path, "--out", other, "--no-report", "--json") == 0
        told = json.loads(capsys.readouterr().out)["findings"]
        assert first.code in [own["code"] for own in told]
