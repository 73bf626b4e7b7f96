"""Texts of any layout, encoding and locale."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.exceptions import FileProblems, InputError
from testbench.formats import import_recording
from testbench.formats.options import Options
from tests.formats.mapped.mappings import PLAIN, check


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "utf-16", "utf-8-sig"])
@pytest.mark.parametrize("stated", [None, "utf-16"])
def test_utf16_with_and_without_its_mark(plain, motion, load, encoding, stated):
    m = motion(300)
    path = plain(m)
    path.write_bytes(path.read_text(encoding="utf-8").encode(encoding))
    if stated and not encoding.startswith(stated):
        return
    key = f"text: {{encoding: {stated}}}\n" if stated else ""
    check(load(PLAIN + key, path).imu("imu"), m)


def test_the_encoding_of_any_format_can_be_stated(motion, table, tmp_path, clock, xyz):
    m = motion(300)
    columns = (
        {"time (s)": m.t} | xyz("Acc {} (m/s²)", m.acc) | xyz("Gyr {} (°/s)", np.degrees(m.gyr))
    )
    path = table("d.csv", columns)
    path.write_bytes(path.read_text(encoding="utf-8").encode("cp1252"))
    with pytest.raises(FileProblems, match=r"not utf-8 text.*--encoding cp1252"):
        import_recording("technaid", [path], tmp_path / "a", clock)
    asked = Options(encoding="cp1252")
    check(import_recording("technaid", [path], tmp_path / "b", clock, asked).imu("d"), m)
    with pytest.raises(InputError, match=r"unknown encoding.*'ebcdic'; known: utf-8"):
        Options(encoding="ebcdic")


@pytest.mark.parametrize("end", ["\r", "\r\n"])
def test_other_ends_of_lines(plain, motion, load, end):
    m = motion(300)
    path = plain(m)
    path.write_bytes(path.read_bytes().replace(b"\n", end.encode()))
    check(load(PLAIN, path).imu("imu"), m)


@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas_below_rows_of_whole_numbers(plain, motion, load, separator):
    m = motion(300)
    path = plain(m, separator=separator, decimal=",", form="%.10f")
    head, *rows = path.read_text().splitlines()
    whole = separator.join(["0", "0", "0", "10", "0", "0", "0"])
    path.write_text("\n".join([head, whole, *rows[1:]]) + "\n")
    np.testing.assert_allclose(load(PLAIN, path).imu("imu").acc[1:], m.acc[1:], atol=1e-6)


@pytest.mark.parametrize(
    ("stamps", "unit", "said"),
    [
        ([f"0{i // 60}:{i % 60:02d}.0" for i in range(300)], "clock", "loses the hours"),
        (["1.7E+12"] * 300, "ms", "'1.7E\\+12' in the column t was rounded.*last digits"),
        (["1,70E+12"] * 300, "ns", "last digits"),
    ],
)
def test_times_that_a_spreadsheet_has_rewritten_are_refused_helpfully(
    plain, motion, load, stamps, unit, said
):
    m = motion(300)
    path = plain(m)
    head, *rows = path.read_text().splitlines()
    rows = [";".join([s, *row.split(",")[1:]]) for s, row in zip(stamps, rows, strict=True)]
    path.write_text("\n".join([head.replace(",", ";"), *rows]) + "\n")
    with pytest.raises(FileProblems, match=said + ".*without opening it in one, or state --rate"):
        load(PLAIN.replace("unit: s", f"unit: {unit}"), path)


@pytest.mark.parametrize(
    ("name", "count"),
    [("12_utf16_without_mark", 120), ("13_decimal_comma_whole_numbers_first", 200)],
)
def test_files_of_other_locales_are_read(name, count, cases, tmp_path, clock):
    asked = Options(str(cases / name / "map.yaml"))
    files = [cases / name / "data.csv"]
    session = import_recording("generic", files, tmp_path / "s", clock, asked)
    assert len(session.imu("imu")) == count


@pytest.mark.parametrize(
    ("layout", "key"),
    [
        ({"separator": ";"}, ""),
        ({"separator": "\t"}, "text: {separator: tab}"),
        ({"separator": ";", "decimal": ","}, ""),
        ({"separator": ";", "decimal": ","}, "text: {separator: semicolon, decimal: comma}"),
        ({"separator": "   "}, "text: {separator: blanks}"),
        ({"above": "a report\nof a device\n"}, "text: {skip_lines: 2}"),
        ({"below": "s,g,g,g,d,d,d\n"}, "text: {lines_below_header: 1}"),
        ({"above": "sep=,\n\n"}, ""),
    ],
)
def test_layouts_of_text(plain, motion, load, layout, key):
    m = motion(600)
    check(load(f"{PLAIN}{key}\n", plain(m, form="%.10f", **layout)).imu("imu"), m)


@pytest.mark.parametrize(
    ("encoding", "key"),
    [("utf-8-sig", ""), ("utf-16", ""), ("latin-1", "text: {encoding: latin-1}\n")],
)
def test_encodings(plain, motion, load, encoding, key):
    m = motion(600)
    path = plain(m, more={"température": m.t})
    path.write_text(path.read_text(encoding="utf-8"), encoding=encoding)
    check(load(PLAIN + key, path).imu("imu"), m)
