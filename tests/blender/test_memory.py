"""Memory does not grow when the extension is enabled and disabled, or processes, again and again.

``POTMESIL_THOROUGH=1`` goes round a thousand times.
"""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import addon_utils
import bpy
import numpy as np
import pytest

from .conftest import PACKAGE

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the system tells it on Linux")

THOROUGH = os.environ.get("POTMESIL_THOROUGH", "") not in ("", "0")
CYCLES, RENDERS = (1000, 1000) if THOROUGH else (100, 25)
WARM_UP = 20
"""Cycles in which lists that Blender keeps short, as that of the last operators, are filled."""

MOST = 4.0
"""Growth in kB each cycle; anything that belongs to a scene or a panel is larger."""


class _MallInfo(ctypes.Structure):
    _fields_ = [
        (name, ctypes.c_size_t)
        for name in (
            "arena",
            "ordblks",
            "smblks",
            "hblks",
            "hblkhd",
            "usmblks",
            "fsmblks",
            "uordblks",
            "fordblks",
            "keepcost",
        )
    ]


def resident() -> float:
    """Return the memory that the process has in use as the system sees it, in kB."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return float(next(line for line in lines if line.startswith("VmRSS")).split()[1])


def allocated() -> float:
    """Return what was asked for and not given back, in kB: freed memory that is kept would hide a leak.

    Small objects of Python's are counted, as its allocator keeps them in large blocks.
    """
    libc = ctypes.CDLL(None)
    if not hasattr(libc, "mallinfo2"):
        return resident()
    libc.mallinfo2.restype = _MallInfo
    info = libc.mallinfo2()
    # A small object takes some 64 bytes.
    return float(info.uordblks + info.hblkhd + 64 * sys.getallocatedblocks()) / 1024.0


def growth(cycle: Callable[[], Any], cycles: int = CYCLES) -> dict[str, float]:
    """Return by how much memory grows with each cycle, in kB.

    Parameters
    ----------
    cycle : callable
        What is done again and again.
    cycles : int
        How often, after a warm-up.

    Returns
    -------
    dict
        The slope of a line through what is allocated after each cycle; of a thousand cycles also through what
        is resident, which grows by whole steps that would count too much in fewer.
    """
    values: dict[str, list[float]] = {"resident": [], "allocated": []}
    for number in range(WARM_UP + cycles):
        cycle()
        if number % 10 == 9:
            gc.collect()
        if number >= WARM_UP:
            values["resident"].append(resident())
            values["allocated"].append(allocated())
    if cycles < 1000:
        del values["resident"]
    return {name: float(np.polyfit(np.arange(cycles), each, 1)[0]) for name, each in values.items()}


@pytest.mark.parametrize("kind", ["python", "blender"])
def test_a_leak_would_be_seen(scene: Any, kind: str) -> None:
    kept = []

    def leak() -> None:
        if kind == "python":
            kept.append(bytearray(10_000))
        else:
            bpy.data.meshes.new("Leak").vertices.add(1_000)

    assert growth(leak, 50)["allocated"] > 9.0


def test_a_thousand_times_on_and_off(extension: Any, scene: Any) -> None:
    def again() -> None:
        addon_utils.disable(PACKAGE)
        addon_utils.enable(PACKAGE)

    found = growth(again)
    print("On and off", found, "empty", growth(_empty_addon))
    assert max(found.values()) < MOST, found


def _empty_addon() -> None:
    """Register and unregister twenty operators with nothing in them."""
    kinds = [
        type(f"EMPTY_OT_{n}", (bpy.types.Operator,), {"bl_idname": f"empty.n{n}", "bl_label": "Empty"})
        for n in range(20)
    ]
    for kind in kinds:
        bpy.utils.register_class(kind)
    for kind in kinds:
        bpy.utils.unregister_class(kind)


def test_a_thousand_pictures(scene: Any) -> None:
    _make_small(scene)
    bpy.ops.potmesil.render()
    found = growth(bpy.ops.potmesil.process)
    print("Pictures", found)
    assert max(found.values()) < MOST, found


def test_many_renders(scene: Any) -> None:
    _make_small(scene)
    found = growth(bpy.ops.potmesil.render, RENDERS)
    print("Renders", found)
    assert max(found.values()) < MOST, found


def _make_small(scene: Any) -> None:
    """Let little be rendered, and processed by the kernels that take least time to compile."""
    scene.render.resolution_x, scene.render.resolution_y = 16, 12
    scene.cycles.samples = 1
    scene.potmesil_camera.visibility = "none"
