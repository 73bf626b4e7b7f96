"""Compiled kernels on disk outlive that what they were compiled for has moved."""

from __future__ import annotations

import importlib
import sys
from types import ModuleType

import pytest
from numba.core import caching

import testbench.model.rotation  # noqa: F401  (any kernel module will do)

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
