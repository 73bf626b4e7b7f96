"""Malformed protocols through the command line: one readable message with file and line, exit code
2, nothing left behind.
"""

import sys
import time

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from testbench.cli import main
from testbench.exceptions import BenchError
from testbench.planning.expansion import expand
from testbench.records.specs.protocol_file import load_protocol
from testbench.records.specs.robot import load_robot
from tests.processes import bench as bench_process
from tests.system.protocol_faults import FAULTS, VALID, WHOLE_FILES

ROBOT = load_robot("ur3e")


def run_cli(monkeypatch, capsys, *arguments):
    """Exit code, standard output and standard error of the command line, run in this process."""
    monkeypatch.setattr(sys, "argv", ["testbench", *map(str, arguments)])
    code = 0
    try:
        main()
    except SystemExit as ended:
        code = ended.code or 0
    out, err = capsys.readouterr()
    return (
        code,
        out,
        err.lstrip("\n"),
    )  # a progress bar that is not on a terminal leaves an empty line


def assert_refused(result, logs, *parts):
    code, out, err = result
    assert code == 2, out + err
    assert out == ""
    assert err
    assert all(line.startswith("error: ") for line in err.splitlines()), err
    for part in parts:
        assert part in err
    assert not logs.exists()


@pytest.fixture
def bench(tmp_path, monkeypatch, capsys):
    """Runs a protocol of the given content and returns the result, the folder of sessions, and the
    file.
    """
    monkeypatch.chdir(tmp_path)

    def run(content, command="run"):
        file = tmp_path / "wave.yaml"
        file.write_bytes(content if isinstance(content, bytes) else content.encode())
        logs = tmp_path / "logs"
        options = ("--logs", logs) if command == "run" else ()
        return run_cli(monkeypatch, capsys, command, file, *options), logs, file

    return run


def test_the_protocol_that_the_faults_are_put_into_is_valid(bench):
    (code, _, err), _, _ = bench(VALID, "check")
    assert (code, err) == (0, "")


@pytest.mark.parametrize("fault", FAULTS.values(), ids=FAULTS.keys())
def test_a_fault_is_refused_once_with_its_file_and_line(bench, fault):
    result, logs, file = bench(fault.text())
    assert_refused(result, logs, fault.says)
    assert len(result[2].splitlines()) == 1, result[2]
    assert result[2].startswith(f"error: {file}:{fault.line()}"), result[2]


@pytest.mark.parametrize(("content", "says"), WHOLE_FILES.values(), ids=WHOLE_FILES.keys())
def test_a_file_that_is_no_protocol_is_refused(bench, content, says):
    start = time.process_time()
    result, logs, file = bench(content)
    assert_refused(result, logs, says, f"error: {file}")
    assert len(result[2].splitlines()) <= 31
    assert time.process_time() - start < 10


def test_several_faults_are_all_reported_in_the_order_of_the_file(bench):
    text = (
        VALID.replace("name: wave", "name: 5")
        .replace("sequence: ZXZ", "sequenz: ZXZ")
        .replace("cycles: 2", "cycles: []")
    )
    result, logs, _ = bench(text)
    assert_refused(result, logs)
    assert [int(line.split(":")[2]) for line in result[2].splitlines()] == [1, 15, 28]


def test_a_thoroughly_wrong_file_does_not_fill_the_terminal(bench):
    result, logs, _ = bench(VALID + "".join(f"unknown_{i}: 1\n" for i in range(500)))
    assert_refused(result, logs, "and 470 more problems")
    assert len(result[2].splitlines()) == 31


@pytest.mark.parametrize(
    "name", ["missing.yaml", "no_such_protocol", "x" * 5000, "x" * 300 + ".yaml", "."]
)
def test_a_protocol_that_is_no_file_is_refused(tmp_path, monkeypatch, capsys, name):
    monkeypatch.chdir(tmp_path)
    result = run_cli(monkeypatch, capsys, "run", name, "--logs", tmp_path / "logs")
    assert_refused(result, tmp_path / "logs", name)


def test_an_unknown_name_lists_the_protocols_that_ship(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    result = run_cli(monkeypatch, capsys, "check", "elbow")
    assert_refused(
        result,
        tmp_path / "logs",
        "unknown protocol 'elbow'; known: axis_identification, beta_zeta, calibration_2d",
    )


def test_includes_that_run_in_a_circle_are_refused(bench, tmp_path):
    include = "- {name: more, include: %s}\n  - name: sweep"
    (tmp_path / "other.yaml").write_text(VALID.replace("- name: sweep", include % "wave.yaml", 1))
    result, logs, _ = bench(VALID.replace("- name: sweep", include % "other.yaml", 1))
    assert_refused(result, logs, "other.yaml:25", "'wave.yaml' includes itself by way of others")


def test_includes_that_multiply_are_refused_quickly(bench, tmp_path):
    def including(name):
        sections = "".join(f"  - {{name: part_{i}, include: {name}}}\n" for i in range(20))
        return VALID.replace("sections:\n", "sections:\n" + sections, 1)

    for i in range(1, 8):
        (tmp_path / f"level_{i}.yaml").write_text(
            including(f"level_{i + 1}.yaml") if i < 7 else VALID
        )
    start = time.process_time()
    result, logs, _ = bench(including("level_1.yaml"))
    assert_refused(result, logs, "includes nest deeper than 5 files")
    assert time.process_time() - start < 10


def test_a_fault_in_an_included_file_is_reported_there(bench, tmp_path):
    (tmp_path / "other.yaml").write_text(VALID.replace("dwell_s: rest_s", "dwell_s: rest_s - 1", 1))
    result, logs, _ = bench(
        VALID.replace("- name: sweep", "- {name: more, include: other.yaml}\n  - name: sweep", 1)
    )
    assert_refused(result, logs, f"error: {tmp_path / 'other.yaml'}:24:", "must be at least 0")


def test_a_loop_without_end_in_sight_is_refused_quickly(bench):
    values = "".join(f"  v{i}: {{start: 1, stop: 90000, step: 1}}\n" for i in range(10))
    text = VALID.replace("variables:\n", "variables:\n" + values).replace(
        "for_each: [flexion_deg]",
        f"for_each: [flexion_deg, {', '.join(f'v{i}' for i in range(9))}]",
    )
    start = time.process_time()
    result, logs, _ = bench(text)
    assert_refused(result, logs, "repeats its steps more than 100000 times")
    assert time.process_time() - start < 10


def test_a_fault_is_refused_in_a_process_of_its_own_too(tmp_path):
    file = tmp_path / "wave.yaml"
    file.write_text(VALID.replace("dwell_s: rest_s", "dwell_s: [1]", 1))
    result = bench_process("run", file, "--logs", tmp_path / "logs", cwd=tmp_path)
    assert result.returncode == 2
    assert result.stdout == ""
    assert result.stderr.lstrip("\n") == (
        f"error: {file}:24:9: sections[0].steps[0].dwell_s: "
        'must be a number or an expression such as "90 - flexion_deg", not [1]\n'
    )
    assert not (tmp_path / "logs").exists()


WORDS = st.sampled_from(
    [
        "",
        " ",
        "\n",
        "\t",
        ":",
        "- ",
        "[",
        "]",
        "{",
        "}",
        "'",
        '"',
        "&a ",
        "*a",
        "!!int ",
        "!!float ",
        "!!bool ",
        "---\n",
        "#",
    ]
    + [
        "|",
        ">",
        "-1",
        "0",
        "1e999",
        ".nan",
        "1e-300",
        "null",
        "true",
        "~",
        "9" * 400,
        "\x00",
        "\ufeff",
        "é",
        "\U0001f600",
    ]
    + [
        r'"\ud800"',
        "%",
        "name",
        "steps",
        "sweep",
        "sine",
        "for_each: [flexion_deg]",
        "flexion_deg",
        "include: wave.yaml",
    ]
    + ["? ", "<<: ", "pi", "sqrt("]
)


@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    cuts=st.lists(
        st.tuples(st.integers(0, len(VALID)), st.integers(0, 12), WORDS | st.text(max_size=8)),
        min_size=1,
        max_size=4,
    )
)
def test_whatever_is_done_to_a_protocol_it_is_read_or_refused(tmp_path_factory, cuts):
    text = VALID
    for start, length, word in cuts:
        text = text[:start] + word + text[start + length :]
    file = tmp_path_factory.mktemp("mutant") / "wave.yaml"
    file.write_bytes(text.encode("utf-8", "surrogatepass"))
    try:
        expand(load_protocol(file), ROBOT)
    except BenchError as error:
        assert str(error)  # noqa: PT017 - which of its kinds it is depends on the text
