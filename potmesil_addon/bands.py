"""How much memory a picture takes, and the bands of rows that it is made in where there is less."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from . import jit
from .errors import MemoryLimitError
from .memory import resident
from .scatter import BAND_ROWS, uses_numba

if TYPE_CHECKING:
    from .focus import FocusSettings

_LEAST_ROWS: Final = 16
"""Rows below which no band is worth it."""

_LEAST_SHARE: Final = 0.125
"""The same as a share of the rows above it, or below, that count for it."""

_KERNELS: Final = 64 * 2**20
"""Bytes that compiled kernels take, once they are loaded, and what is used along with them."""

_PICTURE: Final = 28
"""Bytes a pixel of a picture with its two maps, and a little more."""

_SURVEY: Final = 60
"""Bytes a sample of what is looked at before bands are made."""

_LENS: Final = 48
_SHEET: Final = 45
_LENS_OF_SURFACES: Final = 50
"""Bytes a sample of the focus processor where nothing is hidden, of each surface, and beside those."""

_MOTION: Final = 165
_MOTION_OF_VIEWS: Final = 400
"""Bytes a sample of the motion processor at their most, once it is known what moves; with companions."""

_FINISH: Final = 60
"""Bytes a pixel from the processors' pictures to the finished one."""


@dataclass(frozen=True, slots=True)
class Need:
    """What a stage takes, beyond what the process holds before.

    Parameters
    ----------
    fixed : int
        Bytes, however few the rows.
    row : int
        Bytes for each row of samples that is worked on.
    kept : int
        Bytes for each row of the picture, however many are worked on.
    survey : int
        Bytes for each row while the whole picture is looked at, before there are bands.
    """

    fixed: int
    row: int
    kept: int
    survey: int

    def whole(self, rows: int) -> int:
        """Return the bytes for a picture of some rows at once."""
        return self.fixed + rows * (self.kept + self.row)

    def band(self, rows: int, height: int) -> int:
        """Return the bytes for a picture of some rows, of which so many are taken at a time."""
        return self.fixed + max(rows * self.survey, rows * self.kept + height * self.row)

    def fits(self, rows: int, limit: int) -> bool:
        """Return whether a picture can be made at once."""
        return self.whole(rows) <= limit - resident()


def need_of_lens(settings: FocusSettings, *, sheets: int, columns: int) -> Need:
    """Return what the focus processor takes.

    Parameters
    ----------
    settings : FocusSettings
        Lens, film and how to work.
    sheets : int
        Surfaces of a pixel; 0 where none hides another.
    columns : int
        Columns of the samples.

    Returns
    -------
    Need
        Measured, and a little more.
    """
    channels = 9 if settings.psf.kind == "lommel" else 8
    compiled = uses_numba(settings.backend)
    threads = jit.set_thread_count(None) if compiled else 1
    sums = threads * BAND_ROWS * columns * channels * 8 * (3 if sheets else 1)
    # Of numpy's way the sums are those of all rows.
    of_rows = 0 if compiled else 3 * channels * 8 * 2 + 200
    kept = columns * _PICTURE
    if sheets == 0:
        return Need(_KERNELS + sums, columns * (_LENS + of_rows), kept, kept)
    row = columns * (_LENS_OF_SURFACES + _SHEET * sheets + 4 * threads + of_rows)
    return Need(_KERNELS + sums, row, kept, columns * _SURVEY)


def check_motion(samples: int, limit: int | None, *, views: bool) -> None:
    """Refuse what the motion processor has no room for: it takes a picture as a whole.

    Parameters
    ----------
    samples : int
        Their number.
    limit : int or None
        Bytes that the process may have in all.
    views : bool
        Whether the layer has companions, which hold what moving objects hide.

    Raises
    ------
    MemoryLimitError
        If there is not enough.
    """
    _check(_KERNELS + samples * (_MOTION_OF_VIEWS if views else _MOTION), limit)


def check_picture(pixels: int, limit: int | None) -> None:
    """Refuse a picture that there is no room to finish, whatever the processors take.

    Parameters
    ----------
    pixels : int
        Their number.
    limit : int or None
        Bytes that the process may have in all.

    Raises
    ------
    MemoryLimitError
        If there is not enough.
    """
    _check(pixels * _FINISH, limit)


def _check(need: int, limit: int | None) -> None:
    if limit is not None and resident() + need > limit:
        raise _too_little(resident() + need, limit)


def _too_little(need: int, limit: int) -> MemoryLimitError:
    return MemoryLimitError(
        f"This picture takes {need / 2**30:.2f} GiB of memory and {limit / 2**30:.2f} GiB is all that is "
        "allowed; allow more, or make the picture smaller."
    )


def divide(rows: int, sample_rows: int, margin: int | None, need: Need, limit: int) -> list[tuple[int, int]]:
    """Return the fewest bands in which a picture keeps to a limit.

    Parameters
    ----------
    rows, sample_rows : int
        Rows of the picture, and of the samples.
    margin : int or None
        Rows of samples above and below a band that count for it; None where there can be only one.
    need : Need
        What it takes.
    limit : int
        Bytes that the process may have in all.

    Returns
    -------
    list of (int, int)
        The first row of each band, and the one after its last.

    Raises
    ------
    MemoryLimitError
        If no bands do.
    """
    held = resident()
    least = held + need.whole(sample_rows)
    if least <= limit:
        return [(0, rows)]
    if margin is not None:
        smallest = max(_LEAST_ROWS, int(_LEAST_SHARE * margin))
        for count in range(2, max(2, rows // smallest) + 1):
            height = -(-rows // count)
            taken = held + need.band(sample_rows, min(height + 2 * margin + _LEAST_ROWS, sample_rows))
            least = min(least, taken)
            if taken <= limit:
                return [(first, min(first + height, rows)) for first in range(0, rows, height)]
    raise _too_little(least, limit)
