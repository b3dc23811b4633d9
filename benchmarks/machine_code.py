"""Read the machine code that numba made: whether innermost loops use vectors, and call nothing.

It knows the instructions of x86-64. Only loops with arithmetic on floating-point numbers are of interest.
"""

from __future__ import annotations

import importlib
import pkgutil
import re
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

_FLOAT = re.compile(r"^v?(?:add|sub|mul|div|min|max|sqrt|fn?m(?:add|sub)(?:132|213|231))([ps])[sdh]$")
"""Arithmetic on floating-point numbers; p for packed, s for one number."""

_LABEL = re.compile(r"^([.\w$]+):")
_ARRAY = re.compile(r"%?([xyz])mm\d+")
_BITS = {"x": 128, "y": 256, "z": 512}
_ALLOCATION = re.compile(r"NRT_(?:\w*[Aa]lloc\w*)|malloc|calloc|realloc|numba_alloc")


@dataclass(frozen=True, slots=True)
class Loop:
    """An innermost loop with arithmetic on floating-point numbers.

    Parameters
    ----------
    packed, single : int
        Instructions that work on vectors, and on one number.
    bits : int
        Width of the widest vectors, 0 without.
    calls : tuple of str
        What is called within it.
    """

    packed: int
    single: int
    bits: int
    calls: tuple[str, ...]

    @property
    def vectorised(self) -> bool:
        """Whether at least half of the arithmetic is on vectors."""
        return self.packed > 0 and self.packed >= self.single

    @property
    def allocates(self) -> bool:
        """Whether memory is asked for within it."""
        return any(_ALLOCATION.search(name) for name in self.calls)


def innermost_loops(assembly: str) -> list[Loop]:
    """Find the innermost loops of some assembly (AT&T or Intel syntax, as LLVM writes it).

    A jump back to a label closes a loop. It is innermost where no other loop begins within.

    Parameters
    ----------
    assembly : str
        The text.

    Returns
    -------
    list of Loop
        Those with arithmetic on floating-point numbers, in order.
    """
    labels: dict[str, int] = {}
    lines: list[tuple[str, str]] = []
    # A loop may jump back from several places: it ends with the last.
    ends: dict[int, int] = {}
    for raw in assembly.splitlines():
        text = raw.split("#", 1)[0].strip()
        label = _LABEL.match(text)
        if label:
            labels[label.group(1)] = len(lines)
            text = text[label.end() :].strip()
        if not text or text.startswith("."):
            continue
        name, _, operands = text.partition("\t")
        name, operands = name.strip(), operands.strip()
        if name.startswith("j") and operands in labels:
            ends[labels[operands]] = len(lines)
        lines.append((name, operands))
    found = []
    for start, end in sorted(ends.items()):
        if any(start < other <= end for other in ends):
            continue
        loop = _loop(lines[start : end + 1])
        if loop.packed + loop.single > 0:
            found.append(loop)
    return found


def _loop(lines: list[tuple[str, str]]) -> Loop:
    packed = single = bits = 0
    calls = []
    for name, operands in lines:
        kind = _FLOAT.match(name)
        if kind and kind.group(1) == "p":
            packed += 1
            bits = max([bits, *(_BITS[letter] for letter in _ARRAY.findall(operands))])
        elif kind:
            single += 1
        elif name.startswith("call"):
            calls.append(operands)
    return Loop(packed, single, bits, tuple(calls))


def report(package: str) -> list[dict[str, Any]]:
    """Look at all kernels of a package that this process has compiled.

    Parameters
    ----------
    package : str
        Its name; its modules are imported. Kernels from a cache have no assembly: use an empty one.

    Returns
    -------
    list of dict
        For each kernel ``kernel``, ``parallel`` (whether it runs on all cores; what it calls is in its code
        too) and ``loops``, with what `Loop` tells.
    """
    found = []
    for name, function in sorted(kernels(package)):
        loops: list[Loop] = []
        for text in function.inspect_asm().values():
            loops += innermost_loops(text)
        told = [asdict(loop) | {"vectorised": loop.vectorised, "allocates": loop.allocates} for loop in loops]
        if told:
            parallel = bool(function.targetoptions.get("parallel"))
            found.append({"kernel": name, "parallel": parallel, "loops": told})
    return found


def kernels(package: str) -> Iterator[tuple[str, Any]]:
    """Yield the names and kernels of a package that are compiled."""
    root = importlib.import_module(package)
    for module in pkgutil.iter_modules(root.__path__):
        if module.name == "__main__":
            continue
        space = vars(importlib.import_module(f"{package}.{module.name}"))
        for name, value in space.items():
            own = getattr(value, "__module__", "") == f"{package}.{module.name}"
            if own and hasattr(value, "inspect_asm") and value.signatures:
                yield f"{module.name}.{name}", value
