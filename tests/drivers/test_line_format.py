"""The lines of serial boards: how a format describes them, and what the parser makes of them."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
import yaml

from testbench.drivers.imus.line_format import LineFormat, list_line_formats, load_line_format
from testbench.drivers.imus.line_parser import LineParser, MalformedLine
from testbench.exceptions import FileProblems, NotFoundError
from tests.drivers.board_lines import line, make_format

DEG = np.pi / 180


def test_every_shipped_format_reads_a_line_of_its_board() -> None:
    body = b"65535,4294967295,0,-8192,16384,131,-262,0,-512"
    check = 0
    for byte in body:
        check ^= byte
    lines = {
        "mpu6050": b"$" + body + b"*%02X" % check,
        "mpu6050_plain": b"4294967295 0 -0.5 1 1 -2 0",
        "bno080": b"12.345 0.00 -4.90 9.81 0.02 -0.03 0.00",
    }
    assert sorted(lines) == list_line_formats()
    g, rate = 9.80665, DEG
    expected = {"bno080": [0.02, -0.03, 0, 0, -4.9, 9.81]}
    for name, text in lines.items():
        found = LineParser(load_line_format(name)).parse(text)
        assert found is not None
        np.testing.assert_allclose(
            found.values, expected.get(name, [rate, -2 * rate, 0, 0, -g / 2, g]), atol=1e-12
        )
    found = LineParser(load_line_format("mpu6050")).parse(lines["mpu6050"])
    assert found is not None
    assert (found.counter, found.time_ns) == (65535, (2**32 - 1) * 1000)
    assert found.temperature == pytest.approx(-512 / 340 + 36.53, abs=1e-3)


def test_a_wrong_format_is_refused_with_every_fault_and_its_place(tmp_path: Path) -> None:
    file = tmp_path / "board.yaml"
    file.write_text(
        "description: x\nrate_hz: 100\ncolumns:\n  - {quantity: tme}\n  - {quantity: acceleration, "
        "unit: km}\nbaud: 9600\n"
    )
    with pytest.raises(FileProblems) as caught:
        load_line_format(file)
    text = str(caught.value)
    assert "board.yaml:4:5" in text and "'time'" in text
    assert "board.yaml:5:" in text and "'m/s^2', 'g' or 'mg', not 'km'" in text
    assert "board.yaml:6:1" in text and "unknown key 'baud'" in text
    with pytest.raises(NotFoundError, match="mpu6050"):
        load_line_format("mpu9999")


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (
            [{"quantity": "acceleration", "unit": "g"}],
            "angular_rate needs the axes x, y and z once each, not none",
        ),
        (
            [
                {"quantity": "acceleration", "unit": "g", "axes": ["x", "y", "-y"]},
                {"quantity": "angular_rate", "unit": "deg/s"},
            ],
            "acceleration needs the axes x, y and z once each, not x, y, y",
        ),
        (
            [
                {"quantity": "time", "unit": "s"},
                {"quantity": "time", "unit": "s"},
                {"quantity": "acceleration", "unit": "g"},
                {"quantity": "angular_rate", "unit": "deg/s"},
            ],
            "time stands 2 times",
        ),
    ],
)
def test_columns_that_make_no_sensor_are_refused(columns: list[dict], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make_format(columns=columns)


def test_the_documentation_shows_a_format_that_is_read_and_names_every_key() -> None:
    text = (Path(__file__).parents[2] / "docs" / "devices.md").read_text(encoding="utf-8")
    example = LineFormat.model_validate(yaml.safe_load(text.split("```yaml\n")[1].split("```")[0]))
    assert example == load_line_format("mpu6050").model_copy(update={"source": ""})
    keys = set(LineFormat.model_fields)
    for column in example.columns:
        keys |= set(type(column).model_fields)
    assert [key for key in keys if f"`{key}`" not in text] == []


# The parser


def test_units_axes_counts_and_the_quaternions_direction_are_converted_once() -> None:
    columns = [
        {"quantity": "ignored", "count": 2},
        {
            "quantity": "angular_rate",
            "unit": "deg/s",
            "axes": ["-y", "x", "-z"],
            "counts_per_unit": 10,
            "zero_counts": 5,
        },
        {"quantity": "acceleration", "unit": "mg", "axes": ["z", "y"]},
        {"quantity": "acceleration", "unit": "mg", "axes": ["x"]},
        {"quantity": "magnetic_field", "unit": "G"},
        {"quantity": "quaternion", "order": ["x", "y", "z", "w"], "rotates": "sensor_from_earth"},
    ]
    parser = LineParser(make_format(columns=columns, separator="semicolon"))
    found = parser.parse(b"1;7;15;25;35;1000;2000;3000;0.1;0.2;0.3;0.6;0;0;0.8")
    assert found is not None
    gyr, acc, mag, q = np.split(np.array(found.values), [3, 6, 9])
    np.testing.assert_allclose(gyr, DEG * np.array([2, -1, -3]))
    np.testing.assert_allclose(acc, 9.80665 * np.array([3, 2, 1]))
    np.testing.assert_allclose(mag, [10, 20, 30])
    np.testing.assert_allclose(q, [0.8, -0.6, 0, 0])


def test_the_checksum_is_that_of_nmea_0183() -> None:
    # A GGA sentence as printed in many receivers' manuals; its check digits are 47.
    sentence = b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47"
    line_format = make_format(prefix="$", checksum={"algorithm": "xor"}, separator="comma")
    with pytest.raises(
        MalformedLine, match="has 15 columns"
    ):  # the digits are right, the rest is no sample
        LineParser(line_format).parse(sentence)
    with pytest.raises(MalformedLine, match="its content gives 47"):
        LineParser(line_format).parse(sentence.replace(b"*47", b"*46"))
    summed = make_format(checksum={"algorithm": "sum", "mark": "#"}, comment_prefixes=[])
    body = b"1 0 0 1 0 0 0"
    assert LineParser(summed).parse(body + b"#%02x" % (sum(body) % 256)) is not None


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (b"1 2 3", "has 3 columns, not 7"),
        (b"1 0 0 1 0 0 0 0", "has 8 columns, not 7"),
        (b"1 0 0 x 0 0 0", "no number"),
        (b"1 0 0 nan 0 0 0", "no finite number"),
        (b"1 0 0 inf -inf 0 0", "no finite number"),
        (b"1_0 0 0 1 0 0 0", "no finite number"),
        (b"1 0 0 9.9 0 0 0", "beyond the sensor's range"),
        (b"1e300 0 0 1 0 0 0", "no board counts to"),
        (b"\xff\xfe 0 0 1 0 0 0", "no number"),
    ],
)
def test_a_line_that_does_not_fit_says_why(text: bytes, why: str) -> None:
    with pytest.raises(MalformedLine, match=why):
        LineParser(make_format()).parse(text)


def test_comments_are_passed_over_and_full_scale_is_marked() -> None:
    parser = LineParser(make_format())
    assert parser.parse(b"# t ax ay az gx gy gz") is None and parser.parse(b"  \r") is None
    saturated = parser.parse(b"1 0 0 -2 0 0 0")
    assert saturated is not None and saturated.saturated
    free = parser.parse(b"1 0 0 -1.99 0 0 249")
    assert free is not None and not free.saturated


def test_four_boards_at_400_lines_a_second_cost_little() -> None:
    parser, text = LineParser(make_format()), line(7).strip()
    begin = time.process_time()
    for _ in range(4 * 400):
        parser.parse(text)
    assert (
        time.process_time() - begin < 0.2
    )  # a fifth of one processor for parsing; a hundredth is usual
