import pytest

from testbench.pipeline.run import run
from tests.asking import run_of


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return run(run_of("axis_identification", logs=tmp_path_factory.mktemp("logs"), report=True))


def test_names_every_axis_and_finds_nothing_wrong(result):
    sensor = result.estimate.sensors["sensor"]
    assert [sensor.axes[triad].axes for triad in ("gyr", "acc", "mag")] == [
        "x: +x, y: +y, z: +z"
    ] * 3
    assert not [found for found in sensor.findings if "axes" in str(found) or "reads" in str(found)]


def test_limit_tests_tell_leakage_from_gimbal_lock(result):
    rows = {(row.section, row.filter): row for row in result.evaluation.euler_ranges}
    upright = rows["limit_vertical", "device"]
    assert upright.true_deg[0] is None  # yaw and roll apart mean nothing there
    assert upright.outer_true_deg == pytest.approx(90, abs=0.5)
    assert upright.outer_estimated_deg == pytest.approx(90, abs=1.5)
    rolling = rows["limit_roll", "device"]
    assert rolling.true_deg[0] < 0.1
    assert rolling.true_deg[2] == pytest.approx(40, abs=0.5)
    assert rolling.estimated_deg[2] == pytest.approx(40, abs=1.5)


def test_the_report_shows_them(result):
    html = result.report.read_text(encoding="utf-8")
    assert "Axes of each sensor" in html
    assert "Limit tests" in html


def test_a_sensor_mounted_another_way_than_stated_is_named(altered_protocol, tmp_path):
    def turn(protocol):
        protocol["sensors"]["sensor"]["mounting_error"] = {"rotation_deg": {"XYZ": [0, 0, 90]}}

    sensor = run(
        run_of(altered_protocol("axis_identification", turn), logs=tmp_path)
    ).estimate.sensors["sensor"]
    for triad in ("gyr", "acc", "mag"):
        assert sensor.axes[triad].axes == "x: -y, y: +x, z: +z"
    assert any("other axes than its mounting says" in str(found) for found in sensor.findings)
