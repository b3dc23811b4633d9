"""Pictures as files: with their maps and reports, and with what their headers say of how they were made."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import exr, png
from .batch import SETTINGS_ATTRIBUTE, Mark, Standing, file_digest, settings_hash, standing, worst
from .errors import SettingsError
from .frames import frame_path
from .process import ProcessSettings, Result
from .reports import write_json
from .samples import Float32Array, Samples

_NO_PART_OF_THE_PICTURE = ("backend", "max_memory")
"""Settings that change how a picture is made, and not the picture."""


@dataclass(frozen=True, slots=True)
class PicturePaths:
    """The files of one picture.

    Parameters
    ----------
    output : Path
        The picture.
    mask, error_map, report : Path or None
        What else is written.
    """

    output: Path
    mask: Path | None = None
    error_map: Path | None = None
    report: Path | None = None

    @classmethod
    def of_frame(cls, options: argparse.Namespace, frame: int | None, *, several: bool) -> PicturePaths:
        """Return the files of a frame, as the options name them.

        Parameters
        ----------
        options : argparse.Namespace
            With ``output``, ``mask``, ``error_map`` and ``report``.
        frame : int or None
            The frame's number.
        several : bool
            Whether there are others: see `frame_path`.

        Returns
        -------
        PicturePaths
            The files.
        """

        def named(template: str | Path | None) -> Path | None:
            if template is None or frame is None:
                return None if template is None else Path(template)
            return frame_path(Path(template), frame, several=several)

        output = named(options.output)
        assert output is not None
        return cls(output, named(options.mask), named(options.error_map), named(options.report))

    @property
    def pictures(self) -> tuple[Path, ...]:
        """The picture and its maps."""
        return tuple(path for path in (self.output, self.mask, self.error_map) if path is not None)

    def standing(self, mark: Callable[[], Mark]) -> Standing:
        """Return what the picture and its maps are to a batch.

        Parameters
        ----------
        mark : callable
            Returns how they would be made now; not called where one is missing.

        Returns
        -------
        {"missing", "damaged", "stale", "unknown", "current"}
            The worst of them.
        """
        if self.report is not None and not self.report.is_file():
            return "missing"
        if not all(path.is_file() for path in self.pictures):
            return "missing"
        now = mark()
        return worst([standing(path, now) for path in self.pictures])

    def write(self, result: Result, samples: Samples, mark: Mark, source: Path) -> None:
        """Write all files, the picture last: a frame that has its picture is done.

        Parameters
        ----------
        result : Result
            The picture.
        samples : Samples
            What it was made from.
        mark : Mark
            How.
        source : Path
            The samples file.

        Raises
        ------
        OutputError
            If a file cannot be written.
        """
        self.write_beside(result, samples, mark, source)
        write_result(self.output, result, samples, mark)

    def write_beside(self, result: Result, samples: Samples, mark: Mark, source: Path) -> None:
        """Write the maps and the report of a picture that is written otherwise; see `write`."""
        for path, values in ((self.mask, result.guessed), (self.error_map, result.predicted_error)):
            if path is not None:
                write_map(path, values, result, samples, mark)
        if self.report is not None:
            files = {
                "input": source,
                "output": self.output,
                "mask": self.mask,
                "error_map": self.error_map,
            }
            named = {name: None if path is None else str(path) for name, path in files.items()}
            write_json(self.report, named | result.report)


def refuse_replacing(pictures: Sequence[PicturePaths], sources: Iterable[Path]) -> None:
    """Raise SettingsError if a picture would replace a samples file of any frame, or a map another one."""
    taken = {source.resolve() for source in sources}
    for paths in pictures:
        targets = [path.resolve() for path in paths.pictures]
        if not taken.isdisjoint(targets):
            raise SettingsError("The output would replace the samples file; give another name.")
        if len(set(targets)) < len(targets):
            raise SettingsError("The mask or error map would replace another picture; give another name.")


def picture_mark(
    settings: ProcessSettings,
    layers: tuple[str, ...] | None,
    source: Path,
    more: Mapping[str, Any] | None = None,
) -> Mark:
    """Return how a picture is made: with which settings, and from which samples.

    Parameters
    ----------
    settings : ProcessSettings
        What is done to the samples.
    layers : tuple of str or None
        The view layers that are taken.
    source : Path
        The samples file.
    more : mapping, optional
        What else changes the picture.

    Returns
    -------
    Mark
        What the picture's header will say.

    Raises
    ------
    InputError
        If the samples file is missing or damaged.
    """
    said = exr.read_header(source)
    rendered = said.get(SETTINGS_ATTRIBUTE)
    digest = said.get(exr.DIGEST_ATTRIBUTE)
    return Mark(
        picture_hash(settings, layers, rendered if isinstance(rendered, str) else None, more),
        digest if isinstance(digest, str) else file_digest(source),
    )


def picture_hash(
    settings: ProcessSettings,
    layers: tuple[str, ...] | None,
    rendered: str | None,
    more: Mapping[str, Any] | None = None,
) -> str:
    """Return the hash of all settings behind a picture.

    Parameters
    ----------
    settings : ProcessSettings
        What is done to the samples.
    layers : tuple of str or None
        The view layers that are taken.
    rendered : str or None
        Hash of the settings that the samples were rendered with, where that is known.
    more : mapping, optional
        What else changes the picture.

    Returns
    -------
    str
        See `settings_hash`.

    Raises
    ------
    InputError
        If a picture that an effect names cannot be read.
    """
    values = {name: said for name, said in asdict(settings).items() if name not in _NO_PART_OF_THE_PICTURE}
    for effect in values["effects"].values():
        # A farm's machines may know a picture under other paths.
        if effect and effect.get("image"):
            effect["image"] = file_digest(Path(effect["image"]))
    return settings_hash({"process": values, "layers": layers, "rendered": rendered, **(more or {})})


def write_result(path: Path, result: Result, samples: Samples, mark: Mark | None = None) -> None:
    """Write a picture in the format that its name asks for.

    Parameters
    ----------
    path : Path
        Ends in ``.exr`` (float, scene-linear, premultiplied) or ``.png`` (8-bit sRGB).
    result : Result
        The picture.
    samples : Samples
        Where it came from; its attributes are carried on.
    mark : Mark, optional
        How it was made.

    Raises
    ------
    SettingsError
        If the name has another ending.
    OutputError
        If it cannot be written.
    """
    check_output(path)
    if path.suffix.lower() == ".png":
        png.write_png(path, result.picture, None if mark is None else mark.attributes())
        return
    attributes = {**samples.attributes, **_picture_attributes(result, samples, mark)}
    lens = result.report["lens"]
    if lens is not None:
        attributes["nominalFocalLength"] = float(lens["focal_length_mm"])
        attributes["aperture"] = float(lens["f_stop"])
        distance = lens["focus_distance_m"]
        attributes["focus"] = math.inf if distance is None else float(distance)
        attributes["potmesil:lens"] = json.dumps(lens)
    shutter = result.report["shutter"]
    if shutter is not None:
        attributes["potmesil:shutter"] = json.dumps(
            {name: value for name, value in shutter.items() if value or name == "frames"}
        )
        if samples.shutter.frames_per_second is not None:
            attributes["expTime"] = shutter["frames"] / samples.shutter.frames_per_second
    if result.report["effects"]:
        attributes["potmesil:effects"] = json.dumps(result.report["effects"])
    exr.write_picture(path, result.picture, attributes)


def write_map(
    path: Path, values: Float32Array, result: Result, samples: Samples, mark: Mark | None = None
) -> None:
    """Write a value for each pixel, such as the mask of what was guessed, as a grey picture.

    Parameters
    ----------
    path : Path
        Ends in ``.exr`` (float) or ``.png`` (8 bits through the sRGB curve, as the picture itself).
    values : ndarray of float32 of shape (rows, columns)
        The values, of which a PNG shows those from 0 to 1.
    result : Result
        The picture that they are about.
    samples : Samples
        Where it came from.
    mark : Mark, optional
        How it was made.

    Raises
    ------
    SettingsError
        If the name has another ending.
    OutputError
        If it cannot be written.
    """
    check_output(path)
    grey = np.ones_like(result.picture)
    grey[..., :3] = values[..., np.newaxis]
    if path.suffix.lower() == ".png":
        png.write_png(path, grey, None if mark is None else mark.attributes())
    else:
        exr.write_picture(path, grey, _picture_attributes(result, samples, mark))


def check_output(path: Path) -> None:
    """Raise SettingsError unless a result can be written under this name."""
    if path.suffix.lower() not in (".exr", ".png"):
        raise SettingsError(f"'{path}' must end in .exr or .png.")


def _picture_attributes(result: Result, samples: Samples, mark: Mark | None) -> dict[str, Any]:
    """Return the header attributes that say where a picture lies, and how it was made."""
    window = result.display_window
    box = (
        np.array([window.x0, window.y0], dtype=np.int32),
        np.array([window.x1 - 1, window.y1 - 1], dtype=np.int32),
    )
    place = {"pixelAspectRatio": samples.pixel_aspect, "displayWindow": box, "dataWindow": box}
    return place if mark is None else {**place, **mark.attributes()}
