"""What is installed: the wheel and what it carries, the lock, the console command."""

from __future__ import annotations

import importlib.util
import os
import re
import resource
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import version
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from tests.patience import PATIENCE_S

ROOT = Path(__file__).resolve().parent.parent
COMMAND = Path(sys.executable).with_name("testbench")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
LOCK = (ROOT / "requirements.lock").read_text(encoding="utf-8")

SLOWEST_HELP_S = 1.5
# Nothing that takes long to import may be imported only to show the help.
HEAVY = ["coal", "numba", "pinocchio", "plotly", "pyarrow", "rerun", "ruckig", "scipy"]
# Package registries; in parts, so that this file does not name them either.
HOSTS = [
    ".".join(parts)
    for parts in (
        ("pypi", "org"),
        ("pythonhosted", "org"),
        ("npmjs", "org"),
        ("deb", "debian", "org"),
    )
]

needs_command_line = pytest.mark.skipif(
    importlib.util.find_spec("testbench.cli") is None, reason="there is no command line yet"
)


def source_files(*folders: str) -> list[Path]:
    """The files of the repository, committed or about to be."""
    listing = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", *folders],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    return [ROOT / name for name in listing.split("\0") if name and (ROOT / name).is_file()]


def locked_versions() -> dict[str, str]:
    pins = re.findall(r"^([A-Za-z0-9._-]+)==([^\s;\\]+)", LOCK, flags=re.MULTILINE)
    return {canonical(name): pinned for name, pinned in pins}


def canonical(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    result = subprocess.run(
        [
            sys.executable,
            "-m",
            "pip",
            "--disable-pip-version-check",
            "wheel",
            "--no-index",
            "--no-deps",
        ]
        + ["--no-build-isolation", "--wheel-dir", str(folder), str(ROOT)],
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE_S,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    (path,) = folder.glob("*.whl")
    return path


def test_the_wheel_carries_the_package_its_data_and_nothing_else(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        packed = {name for name in archive.namelist() if ".dist-info/" not in name}
    expected = {path.relative_to(ROOT).as_posix() for path in source_files("testbench")}
    expected |= {
        f"testbench/shipped/{path.relative_to(ROOT).as_posix()}"
        for path in source_files("robots", "protocols", "docs/terms.md")
    }
    assert packed == expected


def test_an_installed_package_finds_its_robots_and_protocols(wheel: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path)
    program = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        "from testbench.records.specs.shipped import shipped_folder\n"
        "sys.stdout.write('\\n'.join(str(shipped_folder(name)) for name in ('robots', "
        "'protocols')))"
    )
    result = subprocess.run(
        [sys.executable, "-I", "-c", program],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
        timeout=PATIENCE_S,
    )
    assert [Path(line) for line in result.stdout.splitlines()] == [
        tmp_path / "testbench" / "shipped" / "robots",
        tmp_path / "testbench" / "shipped" / "protocols",
    ]
    assert list((tmp_path / "testbench" / "shipped" / "robots").rglob("robot.yaml"))


def test_the_wheel_installs_the_command(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        (name,) = [
            name for name in archive.namelist() if name.endswith(".dist-info/entry_points.txt")
        ]
        assert "testbench = testbench.cli:main" in archive.read(name).decode()


def test_the_version_has_one_source() -> None:
    assert version(PROJECT["name"]) == PROJECT["version"]


def test_every_pin_in_the_lock_has_a_hash() -> None:
    entries = [entry for entry in re.split(r"\n(?=[A-Za-z0-9])", LOCK) if not entry.startswith("#")]
    assert len(entries) > 50
    assert [
        entry.splitlines()[0]
        for entry in entries
        if not re.match(r"\S+==\S+.*\\\n    --hash=sha256:", entry)
    ] == []


def test_the_lock_satisfies_every_declared_dependency() -> None:
    pins = locked_versions()
    declared = list(PROJECT["dependencies"])
    for extra in PROJECT["optional-dependencies"].values():
        declared += extra
    unmet = []
    for requirement in map(Requirement, declared):
        if requirement.name != PROJECT["name"]:
            pinned = pins.get(canonical(requirement.name))
            if pinned is None or not requirement.specifier.contains(pinned):
                unmet.append(f"{requirement}: {pinned}")
    assert unmet == []


def test_the_lock_does_not_depend_on_where_it_was_made() -> None:
    assert (
        re.findall(
            r"https?://|file:|--index-url|--extra-index-url|--find-links|--trusted-host| @ |\(/",
            LOCK,
        )
        == []
    )


def test_no_file_names_a_package_registry() -> None:
    found = []
    for path in source_files():
        content = path.read_bytes()
        found += [f"{path.relative_to(ROOT)}: {host}" for host in HOSTS if host.encode() in content]
    assert found == []


@needs_command_line
def test_the_command_tells_its_version() -> None:
    result = subprocess.run(
        [COMMAND, "--version"], capture_output=True, text=True, check=True, timeout=60
    )
    assert PROJECT["version"] in result.stdout


@pytest.mark.parametrize(
    ("first", "threads"),
    [("", "1"), ("import os; os.environ[NAME] = '3'; ", "3"), ("import numpy; ", "None")],
)
def test_the_library_asks_for_one_thread_of_blas_unless_the_program_has_decided(
    first: str, threads: str
) -> None:
    code = (
        f"NAME = 'OPENBLAS_NUM_THREADS'; {first}import os, testbench; print(os.environ.get(NAME))"
    )
    own = {key: value for key, value in os.environ.items() if key != "OPENBLAS_NUM_THREADS"}
    result = subprocess.run(
        [sys.executable, "-c", code], env=own, capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == threads


@needs_command_line
def test_help_imports_nothing_heavy() -> None:
    program = (
        "import sys\nfrom testbench.cli import main\nsys.argv = ['testbench', '--help']\n"
        f"try:\n    main()\nfinally:\n    sys.stderr.write(' '.join(name for name in {HEAVY!r} if "
        "name in sys.modules))"
    )
    result = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, timeout=60
    )
    assert "Usage" in result.stdout
    assert result.stderr == ""


@needs_command_line
def test_help_comes_at_once() -> None:
    """In processor time, which a busy machine does not change."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([COMMAND, "--help"], capture_output=True, check=True, timeout=PATIENCE_S)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    taken = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    assert taken < SLOWEST_HELP_S
