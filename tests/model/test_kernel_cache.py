"""Compiled kernels on disk outlive that what they were compiled for has moved; each is compiled
once.
"""

from __future__ import annotations

import fcntl
import importlib
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType

import pytest
from numba.core import caching

import testbench.model.rotation  # noqa: F401  (any kernel module will do)
from testbench.model import kernel_cache
from tests.patience import PATIENCE_S

PAIR = "from typing import NamedTuple\nclass Pair(NamedTuple):\n    x: float\n    y: float\n"
KERNEL = "from numba import njit\n@njit(cache=True)\ndef total(pair):\n    return pair.x + pair.y\n"


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Loads the module of an upgraded program, as a new process would."""
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "own_kernel.py").write_text(KERNEL, encoding="utf-8")

    def load(*names: str) -> list[ModuleType]:
        for name in ("own_kernel", "own_pairs", "own_shapes"):
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        return [importlib.import_module(name) for name in ("own_kernel", *names)]

    return load


@pytest.mark.parametrize("forgiving", [True, False])
def test_a_kernel_is_compiled_again_where_its_arguments_class_has_moved(
    installed, tmp_path, monkeypatch, forgiving
):
    (tmp_path / "own_pairs.py").write_text(PAIR, encoding="utf-8")
    kernel, pairs = installed("own_pairs")
    assert kernel.total(pairs.Pair(1.0, 2.0)) == 3.0
    assert list(tmp_path.rglob("own_kernel*.nbi"))
    (tmp_path / "own_pairs.py").rename(tmp_path / "own_shapes.py")
    kernel, shapes = installed("own_shapes")
    if not forgiving:  # what is mended here: as numba itself has it
        file = caching.IndexDataCacheFile
        monkeypatch.setattr(file, "_load_index", file._load_index.__wrapped__)
        with pytest.raises((AttributeError, ModuleNotFoundError)):
            kernel.total(shapes.Pair(1.0, 2.0))
        return
    assert kernel.total(shapes.Pair(1.0, 2.0)) == 3.0
    kernel, shapes = installed("own_shapes")
    assert kernel.total(shapes.Pair(1.0, 2.0)) == 3.0
    assert sum(kernel.total.stats.cache_hits.values()) == 1


CALLING = """\
from numba import njit

@njit(cache=True)
def inner(x):
    return 2 * x

@njit(cache=True)
def outer(x):
    return inner(x) + inner(x + 1)
"""
PROCESS = """\
import sys
import testbench.model.rotation
import own_calling
print("ready", flush=True)
sys.stdin.readline()
own_calling.outer(1.0)
print(*(sum(k.stats.cache_misses.values()) for k in (own_calling.inner, own_calling.outer)))
"""


def test_processes_that_start_together_compile_a_kernel_once(tmp_path, monkeypatch):
    (tmp_path / "own_calling.py").write_text(CALLING, encoding="utf-8")
    path = [str(tmp_path), *sys.path]
    monkeypatch.setenv("PYTHONPATH", ":".join(filter(None, path)))
    pipe = subprocess.PIPE
    command = [sys.executable, "-c", PROCESS]
    both = [subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) for _ in range(2)]
    for own in both:
        assert own.stdout.readline() == "ready\n"
    for own in both:  # neither waits for the end of the other
        own.stdin.write("\n")
        own.stdin.flush()
    compiled = [own.communicate(timeout=PATIENCE_S)[0].split() for own in both]
    assert [sum(map(int, counts)) for counts in zip(*compiled, strict=True)] == [1, 1]


def test_a_process_that_was_stopped_is_not_waited_for_for_ever(installed, tmp_path, monkeypatch):
    monkeypatch.setattr(kernel_cache, "LONGEST_WAIT_S", 0.2)
    (tmp_path / "own_pairs.py").write_text(PAIR, encoding="utf-8")
    kernel, pairs = installed("own_pairs")
    index = Path(kernel.total._cache._cache_file._index_path)
    index.parent.mkdir(exist_ok=True)
    with Path(f"{index}.lock").open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        begun = time.monotonic()
        assert kernel.total(pairs.Pair(1.0, 2.0)) == 3.0
        assert time.monotonic() - begun > 0.2
