"""Kinds of surfaces in one number, as the probe's shader reads them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from potmesil_addon.surfaces import SurfaceKind, packed


def kind_of(number: float, slot: int) -> int:
    """Return a slot's kind as a shader finds it, by arithmetic with four bytes."""
    shifted = np.floor(np.float32(number) / np.float32(8.0 ** min(slot, 7)))
    return int(shifted - np.float32(8.0) * np.floor(shifted / np.float32(8.0)))


@pytest.mark.parametrize("kinds", [*itertools.product(SurfaceKind, repeat=2)])
def test_first_slot_is_lowest(kinds: tuple[SurfaceKind, ...]) -> None:
    assert packed(kinds) == kinds[0] + 8 * kinds[1]
    assert [kind_of(packed(kinds), slot) for slot in range(3)] == [*kinds, SurfaceKind.ROUGH]


def test_no_slots_are_rough() -> None:
    assert packed(()) == 0.0


@pytest.mark.parametrize("last", SurfaceKind)
def test_eight_slots_are_exact_in_four_bytes(last: SurfaceKind) -> None:
    kinds = [SurfaceKind.CLEAR, *list(SurfaceKind), SurfaceKind.POLISHED, last]
    assert len(kinds) == 8
    assert float(np.float32(packed(kinds))) == packed(kinds)
    assert [kind_of(packed(kinds), slot) for slot in range(8)] == kinds


def test_further_slots_count_as_the_eighth() -> None:
    kinds = [SurfaceKind.ROUGH] * 7 + [SurfaceKind.GLASS]
    assert packed([*kinds, SurfaceKind.MIRROR]) == packed(kinds)
    assert kind_of(packed([*kinds, SurfaceKind.MIRROR]), 8) == SurfaceKind.GLASS


def test_a_shader_counts_with_these_numbers() -> None:
    assert [(kind.name, kind.value) for kind in SurfaceKind] == [
        ("ROUGH", 0),
        ("POLISHED", 1),
        ("MIRROR", 2),
        ("GLASS", 3),
        ("CLEAR", 4),
    ]
