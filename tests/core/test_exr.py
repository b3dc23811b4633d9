"""Samples files: the camera's round trip, OpenEXR's conventions, every kind of file and of damage."""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest

from potmesil_addon import exr
from potmesil_addon.camera import Camera, Film, FrameFormat, camera_rotation, pan_tilt_swing
from potmesil_addon.errors import InputError, OutputError
from potmesil_addon.lens import Lens
from potmesil_addon.samples import LensAttributes, Window
from potmesil_addon.shutter import ShutterAttributes

from .helpers import DATA, box, crafted_exr, data_files, needs_data, plain_channels, write_exr

MM = 1e-3


def placed(position: Any, pan: float, tilt: float, swing: float) -> Any:
    """Return the world-to-camera matrix of a camera at a place, aimed by its angles."""
    matrix = np.eye(4)
    matrix[:3, :3] = camera_rotation(pan, tilt, swing)
    matrix[:3, 3] = -matrix[:3, :3] @ np.asarray(position)
    return matrix


def some_camera(**frame: Any) -> Camera:
    described = FrameFormat(**{"sensor_width": 36 * MM, "sensor_height": 24 * MM, "resolution_x": 12,
                               "resolution_y": 8, **frame})  # fmt: skip
    return Camera.from_format(placed([1.5, -2.0, 3.0], 0.7, -0.2, 0.1), 50 * MM, described)


LENS = Lens(0.05, 2.8, 4.5, 7, math.radians(15.0), 1.5)


def refused(path: Path) -> str:
    """Return the one sentence with which a file is refused."""
    with pytest.raises(InputError) as caught:
        exr.read_samples(path)
    text = str(caught.value)
    assert "\n" not in text
    assert str(path) in text
    return text


# The camera that travels with the samples


FRAMES: list[dict[str, Any]] = [
    {},
    {"shift_x": 0.2, "shift_y": -0.1},
    {"border": (0.25, 0.75, 0.5, 1.0)},
    {"pixel_aspect_x": 2.0},
    {"resolution_x": 8, "resolution_y": 12, "sensor_fit": "VERTICAL"},
]


@pytest.mark.parametrize("frame", FRAMES)
def test_camera_survives_the_file(tmp_path: Path, frame: dict[str, Any]) -> None:
    camera = some_camera(**frame)
    columns, rows = camera.film.columns, camera.film.rows
    attributes = exr.camera_attributes(camera, LENS, ShutterAttributes(1 / 48, 23.976))
    exr.write_picture(tmp_path / "a.exr", np.ones((rows, columns, 4), dtype=np.float32), attributes)
    samples = exr.read_samples(tmp_path / "a.exr")
    # The header holds single precision.
    read = samples.camera
    assert read is not None
    np.testing.assert_allclose(read.world_to_camera, camera.world_to_camera, atol=1e-6)
    assert read.focal_length == pytest.approx(50 * MM, rel=1e-5)
    assert (read.axis_x, read.axis_y) == pytest.approx((camera.axis_x, camera.axis_y), abs=1e-4)
    angles = pan_tilt_swing(read.world_to_camera[:3, :3])
    np.testing.assert_allclose(angles, (0.7, -0.2, 0.1), atol=1e-6)
    # A point 6 m before the camera.
    ahead = np.linalg.inv(camera.world_to_camera) @ [0.3, -0.2, -6.0, 1.0]
    np.testing.assert_allclose(read.project(ahead[:3])[0], camera.project(ahead[:3])[0], atol=1e-3)
    assert read.project(ahead[:3])[1] == pytest.approx(6.0, abs=1e-5)
    assert samples.film is not None
    assert (samples.film.width, samples.film.height) == pytest.approx(
        (camera.film.width, camera.film.height), rel=1e-6
    )
    assert (samples.film.columns, samples.film.rows) == (columns, rows)
    assert samples.pixel_aspect == pytest.approx(frame.get("pixel_aspect_x", 1.0), rel=1e-6)


def test_lens_and_shutter_survive_the_file(tmp_path: Path) -> None:
    attributes = exr.camera_attributes(some_camera(), LENS, ShutterAttributes(1 / 48, 23.976))
    exr.write_picture(tmp_path / "a.exr", np.ones((8, 12, 4), dtype=np.float32), attributes)
    samples = exr.read_samples(tmp_path / "a.exr")
    lens, shutter = samples.lens, samples.shutter
    assert lens.focal_length == pytest.approx(0.05, rel=1e-6)
    assert lens.f_stop == pytest.approx(2.8, rel=1e-6)
    assert lens.focus_distance == pytest.approx(4.5, rel=1e-6)
    assert lens.blades == 7
    assert lens.blade_rotation == pytest.approx(math.radians(15.0), rel=1e-6)
    assert lens.anamorphic_ratio == pytest.approx(1.5, rel=1e-6)
    assert shutter.exposure_time == pytest.approx(1 / 48, rel=1e-6)
    assert shutter.frames_per_second == pytest.approx(23.976, rel=1e-5)


def test_a_negative_rotation_survives_the_file(tmp_path: Path) -> None:
    lens = Lens(0.05, 2.8, 4.5, 5, math.radians(-20.0))
    exr.write_picture(
        tmp_path / "a.exr",
        np.ones((8, 12, 4), dtype=np.float32),
        exr.camera_attributes(some_camera(), lens, ShutterAttributes()),
    )
    read = exr.read_samples(tmp_path / "a.exr").lens
    assert read.blade_rotation == pytest.approx(math.radians(-20.0), rel=1e-6)


def test_focus_at_infinity_survives_the_file(tmp_path: Path) -> None:
    attributes = exr.camera_attributes(some_camera(), Lens(0.05, 2.8, math.inf), ShutterAttributes())
    exr.write_picture(tmp_path / "a.exr", np.ones((8, 12, 4), dtype=np.float32), attributes)
    assert exr.read_samples(tmp_path / "a.exr").lens.focus_distance == math.inf


def test_what_is_not_known_is_not_written(tmp_path: Path) -> None:
    attributes = exr.camera_attributes(some_camera(), LENS, ShutterAttributes())
    exr.write_picture(tmp_path / "a.exr", np.ones((8, 12, 4), dtype=np.float32), attributes)
    assert exr.read_samples(tmp_path / "a.exr").shutter == ShutterAttributes(None, None)


def test_plain_file_knows_no_camera(tmp_path: Path) -> None:
    samples = exr.read_samples(write_exr(tmp_path / "a.exr", plain_channels(4, 5)))
    assert samples.camera is None
    assert samples.film is None
    assert samples.lens == LensAttributes()
    assert samples.pixel_aspect == 1.0
    assert samples.position == "center"
    assert samples.supersampling == 1


def matrix_in_file(path: Path, name: str) -> Any:
    """Return a matrix from the file's bytes: 16 floats, row by row, as the format says."""
    data = path.read_bytes()
    start = data.index(name.encode() + b"\0m44f\0") + len(name) + 1 + 5
    assert struct.unpack_from("<i", data, start) == (64,)
    return np.array(struct.unpack_from("<16f", data, start + 4)).reshape(4, 4)


def by_hand_file(folder: Path) -> Path:
    """Write the attributes of a camera at (1, 2, 3) turned 90 degrees to the left: it looks along -x."""
    described = FrameFormat(36 * MM, 24 * MM, 1000, 500)
    camera = Camera.from_format(placed([1.0, 2.0, 3.0], math.pi / 2, 0.0, 0.0), 50 * MM, described)
    attributes = exr.camera_attributes(camera, Lens(0.05, 2.8, 5.0), ShutterAttributes(0.02, 25.0))
    exr.write_picture(folder / "a.exr", np.ones((500, 1000, 4), dtype=np.float32), attributes)
    return folder / "a.exr"


# 5 m ahead, 0.36 m to its right (+y), 0.18 m up.
BY_HAND = np.array([1.0 - 5.0, 2.0 + 0.36, 3.0 + 0.18, 1.0])


def test_world_to_camera_is_openexrs(tmp_path: Path) -> None:
    """Row vectors from the left; x right, y up, z into the scene: a left-handed space."""
    matrix = matrix_in_file(by_hand_file(tmp_path), "worldToCamera")
    np.testing.assert_allclose(BY_HAND @ matrix, [0.36, 0.18, 5.0, 1.0], atol=1e-5)
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(-1.0, abs=1e-6)
    # The translation of row vectors is the last row.
    np.testing.assert_allclose(matrix[:, 3], [0.0, 0.0, 0.0, 1.0], atol=0.0)


def test_world_to_ndc_is_openexrs(tmp_path: Path) -> None:
    """From 0 to 1 over the display window, x to the right and y down."""
    matrix = matrix_in_file(by_hand_file(tmp_path), "worldToNDC")
    x, y, _, w = BY_HAND @ matrix
    assert (x / w, y / w) == pytest.approx((0.6, 0.4), abs=1e-5)


def test_units_of_the_standard_attributes_are_openexrs(tmp_path: Path) -> None:
    header = OpenEXR.File(str(by_hand_file(tmp_path)), header_only=True).parts[0].header
    assert header["nominalFocalLength"] == pytest.approx(50.0)  # mm
    assert header["aperture"] == pytest.approx(2.8)
    assert header["focus"] == pytest.approx(5.0)  # m
    assert header["sensorOverallDimensions"].tolist() == pytest.approx([36.0, 18.0])  # mm
    assert header["expTime"] == pytest.approx(0.02)  # s
    assert header["framesPerSecond"] == Fraction(25)
    # At a distance of 1 the window is as wide as the film at the focal length.
    assert header["screenWindowWidth"] == pytest.approx(36.0 / 50.0)
    assert header["screenWindowCenter"].tolist() == pytest.approx([0.0, 0.0], abs=1e-7)
    assert header["pixelAspectRatio"] == 1.0


def test_screen_window_follows_the_shift() -> None:
    """Its centre is what the middle of the picture shows, y up."""
    attributes = exr.camera_attributes(some_camera(shift_x=0.1, shift_y=0.2), LENS, ShutterAttributes())
    # A tenth of 36 mm to the right at 50 mm, a fifth of it up.
    assert attributes["screenWindowCenter"].tolist() == pytest.approx([0.072, 0.144], rel=1e-6)


# Kinds of file


def passes(prefix: str, rows: int = 4, columns: int = 5, index: str = "IndexOB") -> dict[str, Any]:
    """Return a view layer's passes under Blender's names, each with values of its own."""
    base = np.arange(rows * columns, dtype=np.float32).reshape(rows, columns)
    values = {f"Combined.{c}": base + 100.0 * i for i, c in enumerate("RGBA")}
    values["Depth.Z"] = base + 1.0
    values[f"{index}.X"] = base % 3.0
    values |= {f"Vector.{c}": base - 10.0 * i for i, c in enumerate("XYZW")}
    values["Normal.X"] = base
    return {f"{prefix}{name}": value.astype(np.float32) for name, value in values.items()}


def check_passes(path: Path, layer_name: str = "ViewLayer") -> None:
    samples = exr.read_samples(path)
    (layer,) = samples.layers
    base = np.arange(20, dtype=np.float32).reshape(4, 5)
    assert layer.name == layer_name
    assert layer.color.dtype == np.float32
    for i in range(4):
        assert np.array_equal(layer.color[..., i], base + 100.0 * i)
    assert layer.depth is not None
    assert layer.depth.dtype == np.float32
    assert np.array_equal(layer.depth, base + 1.0)
    assert layer.object_index is not None
    assert layer.object_index.dtype == np.int32
    assert np.array_equal(layer.object_index, (base % 3.0).astype(np.int32))
    assert layer.vector is not None
    for i in range(4):
        assert np.array_equal(layer.vector[..., i], base - 10.0 * i)
    assert samples.repaired == {}


@pytest.mark.parametrize("index", ["IndexOB", "Object Index"])
@pytest.mark.parametrize("layer", ["ViewLayer", "Layer.001", "A name. With dots"])
def test_one_part_with_all_passes(tmp_path: Path, layer: str, index: str) -> None:
    write_exr(tmp_path / "a.exr", passes(f"{layer}.", index=index))
    check_passes(tmp_path / "a.exr", layer)


def multi_part(
    path: Path, prefix: str, layer: str = "ViewLayer", more: dict[str, Any] | None = None, **first: Any
) -> Path:
    """Write a part for each pass, named after it; channels begin with `prefix` and the pass' name or not."""
    channels = passes("", index="Object Index") | (more or {})
    parts = []
    for name in dict.fromkeys(full.rsplit(".", 1)[0] for full in channels):
        own = {
            f"{prefix}{full}" if prefix else full.rsplit(".", 1)[1]: values
            for full, values in channels.items()
            if full.rsplit(".", 1)[0] == name
        }
        header: dict[str, Any] = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        if not parts:
            header.update(first)
        parts.append(OpenEXR.Part(header, own, f"{layer}.{name}"))
    OpenEXR.File(parts).write(str(path))
    return path


@pytest.mark.parametrize("prefix", ["ViewLayer.", ""], ids=["full names", "short names"])
def test_one_part_for_each_pass(tmp_path: Path, prefix: str) -> None:
    multi_part(tmp_path / "a.exr", prefix)
    check_passes(tmp_path / "a.exr")


# Layers behind others


def layered(*names: str) -> dict[str, Any]:
    """Return the passes of layers of these names."""
    return {full: values for name in names for full, values in passes(f"{name}.").items()}


def test_layers_behind_come_nearest_first_and_are_no_layers_of_their_own(tmp_path: Path) -> None:
    names = ["View", *(f"View (behind {n})" for n in (2, 10, 1, 9, 3, 8, 4, 7, 5, 6)), "Far (behind 1)"]
    path = write_exr(tmp_path / "a.exr", layered(*names))
    layers = {layer.name: layer for layer in exr.read_samples(path).layers}
    assert sorted(layers) == ["Far (behind 1)", "View"]
    behind = [layer.name for layer in layers["View"].hidden]
    assert behind == [f"View{exr.behind(n)}" for n in range(1, 11)]
    for layer in layers["View"].hidden:
        assert layer.depth is not None
        assert layer.object_index is not None
        assert layer.vector is not None
        assert layer.hidden == ()
    with pytest.raises(InputError, match="no layer 'View \\(behind 1\\)'"):
        exr.read_samples(path, ("View (behind 1)",))


def test_layers_behind_one_without_a_name(tmp_path: Path) -> None:
    channels = plain_channels(4, 5)
    channels |= {f" (behind 1).{name}": values for name, values in plain_channels(4, 5, seed=1).items()}
    (layer,) = exr.read_samples(write_exr(tmp_path / "a.exr", channels)).layers
    assert np.array_equal(layer.hidden[0].depth, channels[" (behind 1).Z"])


def test_a_layer_behind_that_is_missing_or_not_whole_is_refused(tmp_path: Path) -> None:
    path = write_exr(tmp_path / "a.exr", layered("View", "View (behind 2)"))
    assert "'View (behind 1)'" in refused(path)
    assert "is missing" in refused(path)
    for lost in ("Depth", "Combined"):
        channels = layered("View", "View (behind 1)")
        for full in list(channels):
            if full.startswith(f"View (behind 1).{lost}."):
                del channels[full]
        text = refused(write_exr(tmp_path / "a.exr", channels))
        assert "'View (behind 1)'" in text
        assert "lacks colour or depth" in text


def test_a_layer_behind_with_other_pixels_is_refused(tmp_path: Path) -> None:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    smaller = {name: np.ascontiguousarray(v[1:]) for name, v in passes("View (behind 1).").items()}
    window = {"dataWindow": box(0, 1, 4, 3), "displayWindow": box(0, 0, 4, 3)}
    parts = [
        OpenEXR.Part({**header, **window, "dataWindow": box(0, 0, 4, 3)}, passes("View."), "View"),
        OpenEXR.Part({**header, **window}, smaller, "View (behind 1)"),
    ]
    OpenEXR.File(parts).write(str(tmp_path / "a.exr"))
    assert "another data window" in refused(tmp_path / "a.exr")


@pytest.mark.parametrize("single", [True, False])
def test_annotating_with_layers_behind(tmp_path: Path, single: bool) -> None:
    for name in ("in", "one", "two"):
        if single:
            write_exr(tmp_path / f"{name}.exr", passes("ViewLayer."))
        else:
            multi_part(tmp_path / f"{name}.exr", "ViewLayer.")
    companions = {exr.behind(n): tmp_path / f"{name}.exr" for n, name in ((1, "one"), (2, "two"))}
    exr.annotate(tmp_path / "in.exr", tmp_path / "out.exr", {}, companions)
    check_passes(tmp_path / "out.exr")
    (layer,) = exr.read_samples(tmp_path / "out.exr").layers
    assert [other.name for other in layer.hidden] == ["ViewLayer (behind 1)", "ViewLayer (behind 2)"]
    assert np.array_equal(layer.hidden[1].color, layer.color)


# Cryptomatte


IDS = np.array([0x3F8A12C0, 0x00000001, 0x7FC01234, 0xFFA00001, 0x80000000, 0xC0491A3E], dtype=np.uint32)
"""Between usual ones bits that as floats are not normal, NaN, a signalling NaN, and minus zero."""


def coverages(kind: str = "CryptoObject", shape: tuple[int, int] = (4, 5), seed: int = 7) -> dict[str, Any]:
    """Return the channels of three Cryptomatte passes, their ranks in order of coverage."""
    rng = np.random.default_rng(seed)
    ranks = IDS.size
    ids = rng.permuted(np.tile(IDS, (*shape, 1)), axis=2)
    cover = np.sort(rng.random((*shape, ranks)), axis=2)[..., ::-1] / ranks
    cover[1, 1, 1:], ids[1, 1, 1:] = 0.0, 0
    channels = {}
    for rank in range(ranks):
        level, names = rank // 2, ("rg", "ba")[rank % 2]
        bits = np.ascontiguousarray(ids[..., rank])
        channels[f"{kind}{level:02d}.{names[0]}"] = bits.view(np.float32)
        channels[f"{kind}{level:02d}.{names[1]}"] = cover[..., rank].astype(np.float32)
    return channels


def check_coverages(layer: Any, channels: dict[str, Any], kind: str = "CryptoObject") -> None:
    found = layer.cryptomatte
    assert found is not None
    assert (found.ids.dtype, found.coverage.dtype) == (np.uint32, np.float32)
    assert found.ids.shape == found.coverage.shape == (4, *layer.color.shape[:2])
    for rank in range(4):
        level, names = rank // 2, ("rg", "ba")[rank % 2]
        bits = channels[f"{kind}{level:02d}.{names[0]}"].view(np.uint32)
        assert np.array_equal(found.ids[rank], bits)
        assert np.array_equal(found.coverage[rank], channels[f"{kind}{level:02d}.{names[1]}"])


@pytest.mark.parametrize("prefix", ["", "ViewLayer."])
def test_ids_are_read_bit_by_bit(tmp_path: Path, prefix: str) -> None:
    """The first four ranks, which is what is read."""
    channels = {f"{prefix}{name}": values for name, values in coverages().items()}
    base = passes(prefix) if prefix else plain_channels(4, 5)
    (layer,) = exr.read_samples(write_exr(tmp_path / "a.exr", {**base, **channels})).layers
    assert layer.name == prefix.removesuffix(".")
    check_coverages(layer, channels, f"{prefix}CryptoObject")
    assert not exr.read_samples(tmp_path / "a.exr").repaired


@pytest.mark.parametrize(
    ("kinds", "used"),
    [
        (("CryptoMaterial", "CryptoAsset", "CryptoObject"), "CryptoObject"),
        (("crypto_material", "crypto_asset"), "crypto_asset"),
        (("Cryptomatte", "uCryptoMaterial"), "uCryptoMaterial"),
        (("cryptomatte",), "cryptomatte"),
    ],
)
def test_objects_are_preferred_to_assets_and_materials(
    tmp_path: Path, kinds: tuple[str, ...], used: str
) -> None:
    channels = {}
    for seed, kind in enumerate(kinds):
        channels |= coverages(kind, seed=seed)
    path = write_exr(tmp_path / "a.exr", {**plain_channels(4, 5), **channels})
    (layer,) = exr.read_samples(path).layers
    check_coverages(layer, channels, used)


def test_ranks_without_any_id_take_no_memory(tmp_path: Path) -> None:
    channels = coverages()
    for name in list(channels):
        if "00" not in name:
            channels[name] = np.zeros((4, 5), dtype=np.float32)
    (layer,) = exr.read_samples(write_exr(tmp_path / "a.exr", {**plain_channels(4, 5), **channels})).layers
    assert layer.cryptomatte is not None
    assert layer.cryptomatte.ids.shape == (2, 4, 5)
    empty = {name: np.zeros((4, 5), dtype=np.float32) for name in channels}
    (layer,) = exr.read_samples(write_exr(tmp_path / "b.exr", {**plain_channels(4, 5), **empty})).layers
    assert layer.cryptomatte is None


def test_coverages_that_make_no_sense_are_none(tmp_path: Path) -> None:
    channels = coverages()
    channels["CryptoObject00.g"][0, :4] = [np.nan, np.inf, -1.0, 5.0]
    (layer,) = exr.read_samples(write_exr(tmp_path / "a.exr", {**plain_channels(4, 5), **channels})).layers
    assert layer.cryptomatte is not None
    np.testing.assert_array_equal(layer.cryptomatte.coverage[0, 0, :4], [0.0, 0.0, 0.0, 1.0])
    assert (layer.cryptomatte.ids[0, 0, :3] == 0).all()


@pytest.mark.parametrize("spoil", ["half floats", "no coverage"])
def test_a_cryptomatte_that_tells_nothing_is_passed_over(tmp_path: Path, spoil: str) -> None:
    channels = coverages()
    if spoil == "half floats":
        channels = {name: np.ones((4, 5), dtype=np.float16) for name in channels}
    else:
        del channels["CryptoObject00.g"]
    path = write_exr(tmp_path / "a.exr", {**plain_channels(4, 5), **channels})
    (layer,) = exr.read_samples(path).layers
    assert layer.cryptomatte is None


def test_a_cryptomatte_with_other_pixels_is_passed_over(tmp_path: Path) -> None:
    """Some programs crop it to what it covers."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    display = {"displayWindow": box(0, 0, 4, 3)}
    level = {f"main.{name}": values for name, values in coverages().items() if "00" in name}
    for first_row in (0, 1):
        cropped = {name: np.ascontiguousarray(values[first_row:]) for name, values in level.items()}
        windows = [{"dataWindow": box(0, row, 4, 3)} for row in (0, first_row)]
        parts = [
            OpenEXR.Part({**header, **display, **windows[0]}, plain_channels(4, 5), "main"),
            OpenEXR.Part({**header, **display, **windows[1]}, cropped, "main.CryptoObject00"),
        ]
        OpenEXR.File(parts).write(str(tmp_path / "a.exr"))
        (layer,) = exr.read_samples(tmp_path / "a.exr").layers
        assert (layer.cryptomatte is None) == (first_row == 1)


@pytest.mark.parametrize("margins", [(0, 0), (1, 1)])
@pytest.mark.parametrize("single", [True, False])
def test_annotating_keeps_the_coverages_of_all_views(
    tmp_path: Path, single: bool, margins: tuple[int, int]
) -> None:
    files = {name: coverages(seed=number) for number, name in enumerate(("in", "one", "two"))}
    about = {"cryptomatte/542cafa/name": "ViewLayer.CryptoObject", "cryptomatte/542cafa/manifest": "{}"}
    for name, channels in files.items():
        path = tmp_path / f"{name}.exr"
        if single:
            own = {f"ViewLayer.{full}": values for full, values in channels.items()}
            write_exr(path, {**passes("ViewLayer."), **own}, **about)
        else:
            multi_part(path, "ViewLayer.", more=channels, **about)
    companions = {exr.behind(n): tmp_path / f"{name}.exr" for n, name in ((1, "one"), (2, "two"))}
    exr.annotate(tmp_path / "in.exr", tmp_path / "out.exr", {}, companions, margins)
    samples = exr.read_samples(tmp_path / "out.exr")
    (layer,) = samples.layers
    check_coverages(layer, files["in"])
    for other, name in zip(layer.hidden, ("one", "two"), strict=True):
        check_coverages(other, files[name])
    window = samples.data_window
    assert (window.rows, window.columns) == (4, 5)
    header = exr.read_raw(tmp_path / "out.exr").header
    assert {name: header[name] for name in about} == about


def test_plain_channels_of_other_programs(tmp_path: Path) -> None:
    channels = plain_channels(4, 5)
    (layer,) = exr.read_samples(write_exr(tmp_path / "a.exr", channels)).layers
    assert layer.name == ""
    for i, name in enumerate("RGBA"):
        assert np.array_equal(layer.color[..., i], channels[name])
    assert layer.depth is not None
    assert np.array_equal(layer.depth, channels["Z"])
    assert layer.object_index is None
    assert layer.vector is None


def test_a_picture_without_alpha_is_opaque(tmp_path: Path) -> None:
    channels = plain_channels(4, 5)
    del channels["A"]
    (layer,) = exr.read_samples(write_exr(tmp_path / "a.exr", channels)).layers
    assert (layer.color[..., 3] == 1.0).all()


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.uint32])
def test_channel_types(tmp_path: Path, kind: type) -> None:
    values = np.array([[0, 1, 2], [3, 500, 2000]])
    channels = {name: values.astype(kind) for name in ("R", "G", "B", "A", "Z", "Object Index.X")}
    (layer,) = exr.read_samples(write_exr(tmp_path / "a.exr", channels)).layers
    assert layer.color.dtype == np.float32
    assert layer.color[..., 1].tolist() == values.tolist()
    assert layer.depth is not None
    assert layer.depth[0, 1:].tolist() == [1.0, 2.0]
    assert layer.depth[0, 0] == math.inf
    assert layer.object_index is not None
    assert layer.object_index.tolist() == values.tolist()


def tiled(path: Path, mode: Any = None, side: int = 4) -> Path:
    tiles = OpenEXR.TileDescription()
    tiles.xSize = tiles.ySize = side
    if mode is not None:
        tiles.mode = mode
    return write_exr(path, plain_channels(7, 10), type=OpenEXR.tiledimage, tiles=tiles)


def test_tiles(tmp_path: Path) -> None:
    (layer,) = exr.read_samples(tiled(tmp_path / "a.exr")).layers
    expected = plain_channels(7, 10)
    assert layer.depth is not None
    assert np.array_equal(layer.depth, expected["Z"])
    assert np.array_equal(layer.color[..., 2], expected["B"])


@pytest.mark.parametrize(
    "compression",
    ["NO_COMPRESSION", "RLE_COMPRESSION", "ZIPS_COMPRESSION", "ZIP_COMPRESSION", "PIZ_COMPRESSION"],
)
def test_lossless_compressions(tmp_path: Path, compression: str) -> None:
    path = write_exr(tmp_path / "a.exr", plain_channels(40, 30), compression=getattr(OpenEXR, compression))
    (layer,) = exr.read_samples(path).layers
    assert layer.depth is not None
    assert np.array_equal(layer.depth, plain_channels(40, 30)["Z"])


@pytest.mark.parametrize(
    ("data", "display"),
    [
        ((2, 1, 6, 4), (0, 0, 9, 5)),  # within the picture
        ((-3, -2, 1, 1), (0, 0, 9, 5)),  # across its corner, before 0
        ((0, 0, 4, 3), (10, 20, 12, 23)),  # beside it
    ],
)
def test_data_window_unlike_display_window(tmp_path: Path, data: Any, display: Any) -> None:
    path = write_exr(
        tmp_path / "a.exr", plain_channels(4, 5), dataWindow=box(*data), displayWindow=box(*display)
    )
    samples = exr.read_samples(path)
    assert samples.data_window == Window(data[0], data[1], data[2] + 1, data[3] + 1)
    assert samples.display_window == Window(display[0], display[1], display[2] + 1, display[3] + 1)
    assert samples.layers[0].color.shape == (4, 5, 4)


def test_corner_samples_and_supersampling_are_said_by_attributes(tmp_path: Path) -> None:
    header = {
        "potmesil:samplePosition": "corner",
        "potmesil:supersampling": 2,
        "displayWindow": box(0, 0, 9, 5),
        "dataWindow": box(0, 0, 10, 6),
    }
    samples = exr.read_samples(write_exr(tmp_path / "a.exr", plain_channels(7, 11), **header))
    assert samples.position == "corner"
    assert samples.supersampling == 2


@pytest.mark.parametrize(
    ("header", "word"),
    [
        ({"potmesil:samplePosition": "edge"}, "center or corner"),
        ({"potmesil:samplePosition": np.array([1.0, 2.0], dtype=np.float32)}, "center or corner"),
        ({"potmesil:filter": "[]"}, "pixel filter"),
        ({"potmesil:filter": "{"}, "pixel filter"),
        ({"potmesil:filter": '{"pixel_variance": 0.17}'}, "pixel filter"),
        ({"potmesil:filter": '{"pixel_variance": -1, "sample_variance": 0.1}'}, "pixel filter"),
        ({"potmesil:supersampling": 7}, "1 to 4"),
        ({"potmesil:supersampling": 1.5}, "1 to 4"),
        ({"potmesil:supersampling": 2}, "multiple"),
    ],
)
def test_attributes_that_make_no_sense_are_refused(tmp_path: Path, header: dict[str, Any], word: str) -> None:
    assert word in refused(write_exr(tmp_path / "a.exr", plain_channels(3, 5), **header))


FILM_AND_NDC = {
    "worldToNDC": np.eye(4, dtype=np.float32),
    "sensorOverallDimensions": np.array([36.0, 24.0], dtype=np.float32),
}


@pytest.mark.parametrize(
    "header",
    [
        {"focus": "near", "aperture": "wide", "nominalFocalLength": "long", "expTime": "short"},
        {"focus": -1.0, "aperture": 0.0, "nominalFocalLength": math.nan, "expTime": math.inf},
        {"sensorOverallDimensions": np.array([0.0, 24.0], dtype=np.float32)},
        {"sensorOverallDimensions": np.array([math.nan, 24.0], dtype=np.float32)},
        {"worldToCamera": np.zeros((4, 4), dtype=np.float32), **FILM_AND_NDC},
        {"worldToCamera": np.full((4, 4), np.nan, dtype=np.float32), **FILM_AND_NDC},
        {"worldToCamera": -np.eye(4, dtype=np.float32), **FILM_AND_NDC},
    ],
)
def test_attributes_that_say_nothing_usable_are_passed_over(tmp_path: Path, header: dict[str, Any]) -> None:
    samples = exr.read_samples(write_exr(tmp_path / "a.exr", plain_channels(3, 5), **header))
    assert samples.lens == LensAttributes()
    assert samples.camera is None
    assert samples.shutter == ShutterAttributes()


def test_an_attribute_of_an_unknown_type_is_passed_over(tmp_path: Path) -> None:
    for name in ("multiView", "focus", "worldToCamera", "sensorOverallDimensions", "potmesil:apertureBlades"):
        path = tmp_path / "a.exr"
        path.write_bytes(crafted_exr([(c, 1, 1) for c in "ABGRZ"], extra=[(name, "unheardOf", b"12345678")]))
        assert exr.read_samples(path).lens == LensAttributes()


# Layers and views


def test_layers_with_a_depth_are_taken_where_any_has_one(tmp_path: Path) -> None:
    channels = {**passes("back."), **passes("front.")}
    channels |= {f"overlay.Combined.{c}": channels[f"back.Combined.{c}"] for c in "RGBA"}
    samples = exr.read_samples(write_exr(tmp_path / "a.exr", channels))
    assert sorted(layer.name for layer in samples.layers) == ["back", "front"]


def test_without_any_depth_one_layer_is_taken(tmp_path: Path) -> None:
    channels = {name: v for layer in "ab" for name, v in passes(f"{layer}.").items() if "Combined" in name}
    (layer,) = exr.read_samples(write_exr(tmp_path / "x.exr", channels)).layers
    assert layer.name == "a"
    assert layer.depth is None


def test_layers_can_be_chosen_and_ordered(tmp_path: Path) -> None:
    path = write_exr(tmp_path / "a.exr", {**passes("a."), **passes("b."), **passes("c.")})
    assert [layer.name for layer in exr.read_samples(path, ("c", "a")).layers] == ["c", "a"]
    with pytest.raises(InputError, match=r"no layer 'd'; it has 'a', 'b', 'c'"):
        exr.read_samples(path, ("a", "d"))


def test_stereo_in_one_part_gives_the_first_view(tmp_path: Path) -> None:
    """Blender up to 4.5. The other view is a picture of its own, not a layer behind this one."""
    channels = {}
    for view in ("left", "right"):
        for name, values in passes("ViewLayer.").items():
            stem, component = name.rsplit(".", 1)
            channels[f"{stem}.{view}.{component}"] = values + (1000.0 if view == "right" else 0.0)
    write_exr(tmp_path / "a.exr", channels, multiView=["left", "right"])
    check_passes(tmp_path / "a.exr")


def test_stereo_in_a_part_for_each_pass_gives_the_first_view(tmp_path: Path) -> None:
    """Blender 5.x: parts such as ViewLayer.Combined-left with a view attribute, channels without the view."""
    parts = []
    for name in ("Combined", "Depth", "Object Index", "Vector"):
        for view in ("left", "right"):
            own = {
                full: values + (1000.0 if view == "right" else 0.0)
                for full, values in passes("ViewLayer.", index="Object Index").items()
                if full.startswith(f"ViewLayer.{name}.")
            }
            header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, "view": view}
            parts.append(OpenEXR.Part(header, own, f"ViewLayer.{name}-{view}"))
    OpenEXR.File(parts).write(str(tmp_path / "a.exr"))
    check_passes(tmp_path / "a.exr")


def test_plain_stereo_gives_the_first_view(tmp_path: Path) -> None:
    channels = plain_channels(4, 5)
    other = {f"left.{name}": values + 50.0 for name, values in channels.items()}
    path = write_exr(tmp_path / "a.exr", {**channels, **other}, multiView=["right", "left"])
    (layer,) = exr.read_samples(path).layers
    assert layer.name == ""
    assert layer.depth is not None
    assert np.array_equal(layer.depth, channels["Z"])


def test_parts_with_different_data_windows_are_refused(tmp_path: Path) -> None:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    window = {"displayWindow": box(0, 0, 4, 3)}
    channels = plain_channels(4, 5)
    color = OpenEXR.Part({**header, **window}, {name: channels[name] for name in "RGBA"}, "V.Combined")
    depth = OpenEXR.Part(
        {**header, **window, "dataWindow": box(0, 0, 3, 3)},
        {"Z": np.ascontiguousarray(channels["Z"][:, :4])},
        "V.Depth",
    )
    OpenEXR.File([color, depth]).write(str(tmp_path / "a.exr"))
    assert "different data windows" in refused(tmp_path / "a.exr")


# Values that are not finite


def test_broken_colors_are_repaired_and_counted(tmp_path: Path) -> None:
    channels = plain_channels(3, 3)
    channels["G"][1, 1] = np.nan
    channels["R"][0, 0] = np.inf
    channels["A"][2, 2] = -np.inf
    expected = channels["G"][[0, 0, 1, 1, 2, 2], [1, 2, 0, 2, 0, 1]].astype(np.float64).mean()
    samples = exr.read_samples(write_exr(tmp_path / "a.exr", channels))
    assert samples.repaired == {"color": 3}
    color = samples.layers[0].color
    assert np.isfinite(color).all()
    # A pixel is repaired whole, from neighbours that were sound.
    assert color[1, 1, 1] == pytest.approx(expected, rel=1e-6)
    assert color[0, 1, 0] == channels["R"][0, 1]


@pytest.mark.parametrize(
    ("kind", "no_surface"),
    [
        (np.float32, [math.inf, 1e10, 1e9, 0.0, -1.0, -math.inf]),
        (np.float16, [math.inf, 65504.0, 0.0, -2.0]),
    ],
)
def test_no_surface_is_at_infinity_and_no_repair(tmp_path: Path, kind: type, no_surface: list[float]) -> None:
    values = np.array([[*no_surface, 2.0, 1000.0]])
    channels = {name: np.ones(values.shape, dtype=np.float32) for name in "RGB"}
    samples = exr.read_samples(write_exr(tmp_path / "a.exr", {**channels, "Z": values.astype(kind)}))
    depth = samples.layers[0].depth
    assert depth is not None
    assert depth[0].tolist() == [math.inf] * len(no_surface) + [2.0, 1000.0]
    assert samples.repaired == {}


def test_float_depth_of_65504_is_a_depth(tmp_path: Path) -> None:
    channels = {name: np.ones((1, 1), dtype=np.float32) for name in "RGB"}
    channels["Z"] = np.array([[65504.0]], dtype=np.float32)
    depth = exr.read_samples(write_exr(tmp_path / "a.exr", channels)).layers[0].depth
    assert depth is not None
    assert depth.tolist() == [[65504.0]]


def test_nan_depth_takes_the_mean_of_inverse_depths(tmp_path: Path) -> None:
    channels = {name: np.ones((1, 5), dtype=np.float32) for name in "RGB"}
    channels["Z"] = np.array([[2.0, np.nan, np.inf, np.nan, 4.0]], dtype=np.float32)
    samples = exr.read_samples(write_exr(tmp_path / "a.exr", channels))
    depth = samples.layers[0].depth
    assert depth is not None
    # (1/2 + 0) / 2 and (0 + 1/4) / 2
    assert depth.tolist() == [[2.0, 4.0, math.inf, 8.0, 4.0]]
    assert samples.repaired == {"depth": 2}


def test_nothing_but_nan_depth_is_no_surface(tmp_path: Path) -> None:
    channels = {name: np.ones((2, 3), dtype=np.float32) for name in "RGB"}
    channels["Z"] = np.full((2, 3), np.nan, dtype=np.float32)
    samples = exr.read_samples(write_exr(tmp_path / "a.exr", channels))
    assert samples.layers[0].depth is not None
    assert np.isposinf(samples.layers[0].depth).all()
    assert samples.repaired == {"depth": 6}


def test_broken_vectors_and_indices_are_repaired_and_counted(tmp_path: Path) -> None:
    channels = passes("ViewLayer.")
    channels["ViewLayer.Vector.Z"][0, 0] = np.nan
    channels["ViewLayer.IndexOB.X"][1, 1] = np.nan
    channels["ViewLayer.IndexOB.X"][2, 2] = np.inf
    samples = exr.read_samples(write_exr(tmp_path / "a.exr", channels))
    layer = samples.layers[0]
    assert samples.repaired == {"vector": 1, "object_index": 2}
    assert layer.vector is not None
    assert np.isfinite(layer.vector).all()
    assert layer.object_index is not None
    assert (layer.object_index[1, 1], layer.object_index[2, 2]) == (0, 0)


@pytest.mark.parametrize(
    "values",
    [
        np.array([[7, 2**32 - 1, 2**31, 3]], dtype=np.uint32),
        np.array([[7.0, 1e20, -1e20, 3.0]], dtype=np.float32),
    ],
)
def test_indices_beyond_32_bits_spoil_nothing(tmp_path: Path, values: Any) -> None:
    """Without a warning either: the command line promises a quiet standard error."""
    channels = {name: np.ones((1, 4), dtype=np.float32) for name in "RGBZ"}
    samples = exr.read_samples(write_exr(tmp_path / "a.exr", {**channels, "Object Index.X": values}))
    index = samples.layers[0].object_index
    assert index is not None
    assert (index[0, 0], index[0, 3]) == (7, 3)


# Files that are refused


def test_missing_file_is_refused(tmp_path: Path) -> None:
    assert "does not exist" in refused(tmp_path / "none.exr")


def test_a_folder_is_refused(tmp_path: Path) -> None:
    refused(tmp_path)


@pytest.mark.parametrize(
    "content", [b"", b"not a picture\nat all\n", b"\x76\x2f\x31\x01", b"\0" * 4096, b"\x89PNG\r\n"]
)
def test_what_is_no_exr_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.exr").write_bytes(content)
    refused(tmp_path / "a.exr")


def test_deep_images_are_refused(tmp_path: Path) -> None:
    deep = np.empty((3, 4), dtype=object)
    for row, column in np.ndindex(3, 4):
        deep[row, column] = np.ones(column, dtype=np.float32)
    channels = dict.fromkeys("RGBZ", deep)
    header = {"compression": OpenEXR.ZIPS_COMPRESSION, "type": OpenEXR.deepscanline}
    try:
        write_exr(tmp_path / "a.exr", channels, **header)
    except Exception as error:
        pytest.skip(f"this OpenEXR module writes no deep images: {error}")
    assert "deep" in refused(tmp_path / "a.exr")


@pytest.mark.parametrize("mode", ["MIPMAP_LEVELS", "RIPMAP_LEVELS"])
def test_mip_mapped_tiles_are_refused(tmp_path: Path, mode: str) -> None:
    try:
        tiled(tmp_path / "a.exr", getattr(OpenEXR, mode))
    except Exception as error:
        pytest.skip(f"this OpenEXR module writes no levels: {error}")
    assert "mip-mapped" in refused(tmp_path / "a.exr")


def test_the_crafted_file_is_sound(tmp_path: Path) -> None:
    """Without its subsampling it is read, so nothing else is what the next tests are refused for."""
    (tmp_path / "a.exr").write_bytes(crafted_exr([(c, 1, 1) for c in "ABGRZ"]))
    assert exr.read_samples(tmp_path / "a.exr").layers[0].color.shape == (8, 8, 4)


def test_luminance_chroma_images_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.exr").write_bytes(crafted_exr([("BY", 2, 2), ("RY", 2, 2), ("Y", 1, 1)]))
    assert "luminance-chroma" in refused(tmp_path / "a.exr")


def test_luminance_alone_is_refused(tmp_path: Path) -> None:
    assert "R, G, B" in refused(write_exr(tmp_path / "a.exr", {"Y": np.ones((3, 4), dtype=np.float32)}))


def test_subsampled_channels_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.exr").write_bytes(
        crafted_exr([("A", 1, 1), ("B", 1, 1), ("G", 1, 1), ("R", 1, 1), ("Z", 2, 2)])
    )
    assert "subsampled" in refused(tmp_path / "a.exr")


def test_a_file_without_color_is_refused(tmp_path: Path) -> None:
    assert "R, G, B" in refused(write_exr(tmp_path / "a.exr", {"Z": np.ones((3, 4), dtype=np.float32)}))


def test_a_huge_claim_is_refused_without_the_memory(tmp_path: Path) -> None:
    """A damaged header that claims 65536 x 65536 pixels."""
    data = crafted_exr([(c, 1, 1) for c in "BGR"])
    small = struct.pack("<4i", 0, 0, 7, 7)
    (tmp_path / "a.exr").write_bytes(data.replace(small, struct.pack("<4i", 0, 0, 65535, 65535)))
    assert "65536 x 65536" in refused(tmp_path / "a.exr")


def good_file(folder: Path) -> bytes:
    """Return a small samples file with everything that is read of one."""
    attributes = exr.camera_attributes(some_camera(), LENS, ShutterAttributes(0.02, 24.0))
    path = folder / "good.exr"
    write_exr(path, passes("ViewLayer.", 8, 12), **attributes)
    exr.read_samples(path)
    return path.read_bytes()


def test_truncated_files_are_refused(tmp_path: Path) -> None:
    data = good_file(tmp_path)
    path = tmp_path / "cut.exr"
    for length in [*range(0, len(data), 37), *range(len(data) - 40, len(data))]:
        path.write_bytes(data[:length])
        refused(path)


def outcome(path: Path) -> str:
    """Return whether a file is read or refused, and otherwise what went wrong."""
    try:
        exr.read_samples(path)
    except InputError as error:
        return "refused" if "\n" not in str(error) else f"more than one line: {error}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return "read"


def mutations(data: bytes, count: int) -> Iterator[tuple[int, bytes]]:
    """Yield a seed and the file with one byte of it changed."""
    for seed in range(count):
        rng = np.random.default_rng(seed)
        changed = bytearray(data)
        changed[int(rng.integers(len(data)))] ^= int(rng.integers(1, 256))
        yield seed, bytes(changed)


def small_files(folder: Path) -> dict[str, bytes]:
    multi_part(folder / "multi.exr", "ViewLayer.")
    stereo = plain_channels(4, 5)
    other = {f"left.{name}": values for name, values in stereo.items()}
    write_exr(folder / "stereo.exr", {**stereo, **other}, multiView=["right", "left"])
    return {
        "one part": good_file(folder),
        "parts": (folder / "multi.exr").read_bytes(),
        "stereo": (folder / "stereo.exr").read_bytes(),
    }


@pytest.mark.parametrize("kind", ["one part", "parts", "stereo"])
def test_one_wrong_byte_is_read_or_refused(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "mutated.exr"
    outcomes = {}
    for seed, data in mutations(small_files(tmp_path)[kind], 200):
        path.write_bytes(data)
        outcomes[seed] = outcome(path)
    assert not {seed: text for seed, text in outcomes.items() if text not in ("read", "refused")}
    assert set(outcomes.values()) == {"read", "refused"}


@pytest.mark.parametrize("name", ["dataWindow", "displayWindow", "channels", "multiView"])
def test_any_wrong_byte_of_a_main_attribute_is_read_or_refused(tmp_path: Path, name: str) -> None:
    data = small_files(tmp_path)["stereo"]
    start = data.index(name.encode() + b"\0")
    outcomes = {}
    for at in range(start, start + 48):
        for flip in (0x01, 0x80):
            changed = bytearray(data)
            changed[at] ^= flip
            (tmp_path / "mutated.exr").write_bytes(changed)
            outcomes[at - start, flip] = outcome(tmp_path / "mutated.exr")
    assert not {place: text for place, text in outcomes.items() if text not in ("read", "refused")}


@needs_data
@pytest.mark.parametrize("path", data_files("exr-damaged"), ids=lambda path: path.name[-24:])
def test_files_from_fuzzers_are_refused(path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    refused(path)
    # The library's own complaints stay off the terminal.
    assert capfd.readouterr() == ("", "")


def test_files_are_read_where_there_is_no_standard_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A windowed program has none to keep quiet."""

    def absent(_: int) -> int:
        raise OSError(9, "Bad file descriptor")

    path = write_exr(tmp_path / "a.exr", plain_channels(3, 4))
    monkeypatch.setattr(os, "dup", absent)
    assert exr.read_samples(path).layers[0].color.shape == (3, 4, 4)


# Files of other programs


@needs_data
def test_an_older_blenders_file() -> None:
    samples = exr.read_samples(DATA / "exr" / "cube0001.exr")
    (layer,) = samples.layers
    assert layer.name == ""
    assert layer.depth is not None
    # A cube before nothing, which a half says as 65504.
    assert float(layer.depth.min()) == 9.6171875
    assert np.isinf(layer.depth).any()
    assert float(layer.depth[np.isfinite(layer.depth)].max()) < 20.0


@needs_data
@pytest.mark.parametrize(
    ("name", "data", "display"),
    [
        ("t05.exr", Window(0, 0, 400, 300), Window(30, 20, 370, 280)),
        ("t08.exr", Window(30, 40, 430, 340), Window(0, 0, 501, 401)),
        ("beachball-singlepart.0001.exr", Window(654, 245, 1565, 1121), Window(0, 0, 2048, 1556)),
    ],
)
def test_windows_of_real_files(name: str, data: Window, display: Window) -> None:
    samples = exr.read_samples(DATA / "exr" / name)
    assert samples.data_window == data
    assert samples.display_window == display
    assert samples.layers[0].color.shape == (data.rows, data.columns, 4)


@needs_data
def test_stereo_of_another_program_gives_its_first_view() -> None:
    path = DATA / "exr" / "beachball-singlepart.0001.exr"
    (layer,) = exr.read_samples(path).layers
    stored = OpenEXR.File(str(path), separate_channels=True).channels()
    depth = stored["Z"].pixels.astype(np.float32)
    assert layer.depth is not None
    assert np.array_equal(layer.depth, np.where(depth > 0.0, depth, np.inf))
    assert np.array_equal(layer.color[..., 0], stored["R"].pixels.astype(np.float32))


@needs_data
def test_real_nan_and_infinity_are_repaired() -> None:
    broken = OpenEXR.File(str(DATA / "exr" / "BrightRingsNanInf.exr"), separate_channels=True).channels()
    color = np.stack([broken[name].pixels.astype(np.float32) for name in "RGB"], axis=2)
    sound = np.isfinite(color).all(axis=2)
    samples = exr.read_samples(DATA / "exr" / "BrightRingsNanInf.exr")
    assert samples.repaired == {"color": int((~sound).sum())}
    assert samples.repaired["color"] > 0
    repaired = samples.layers[0].color[..., :3]
    assert np.isfinite(repaired).all()
    assert np.array_equal(repaired[sound], color[sound])
    assert repaired.max() <= color[sound].max()


# Writing


def picture(rows: int = 6, columns: int = 7) -> Any:
    return np.random.default_rng(3).random((rows, columns, 4)).astype(np.float32)


def test_picture_is_written_as_float_rgba_first_row_on_top(tmp_path: Path) -> None:
    values = picture()
    exr.write_picture(tmp_path / "out.exr", values, {"displayWindow": box(0, 0, 6, 5), "focus": 2.0})
    part = OpenEXR.File(str(tmp_path / "out.exr"), separate_channels=True).parts[0]
    assert sorted(part.channels) == ["A", "B", "G", "R"]
    for i, name in enumerate("RGBA"):
        assert part.channels[name].pixels.dtype == np.float32
        assert np.array_equal(part.channels[name].pixels, values[..., i])
    assert part.header["focus"] == 2.0
    assert [path.name for path in tmp_path.iterdir()] == ["out.exr"]


def test_missing_output_folder_is_made(tmp_path: Path) -> None:
    exr.write_picture(tmp_path / "a" / "b" / "out.exr", picture(), {})
    assert exr.read_samples(tmp_path / "a" / "b" / "out.exr").layers[0].color.shape == (6, 7, 4)


def test_attributes_are_left_as_they_were(tmp_path: Path) -> None:
    """The OpenEXR module changes the dictionaries that it is given."""
    attributes = exr.camera_attributes(some_camera(), LENS, ShutterAttributes())
    before = set(attributes)
    exr.write_picture(tmp_path / "a.exr", picture(8, 12), attributes)
    assert set(attributes) == before
    assert isinstance(attributes["nominalFocalLength"], float)


def annotated(tmp_path: Path) -> None:
    exr.annotate(tmp_path / "in.exr", tmp_path / "out.exr", {"focus": 2.0})


def written(tmp_path: Path) -> None:
    exr.write_picture(tmp_path / "out.exr", picture(60, 70), {})


@pytest.mark.parametrize("write", [written, annotated])
def test_a_full_disk_leaves_the_old_file_and_no_part(tmp_path: Path, write: Callable[[Path], None]) -> None:
    resource = pytest.importorskip("resource", reason="limits of file size are POSIX's")
    write_exr(tmp_path / "in.exr", plain_channels(60, 70))
    (tmp_path / "out.exr").write_bytes(b"old")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    size = (tmp_path / "in.exr").stat().st_size
    try:
        for limit in (0, 100, 1000, size // 2):
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
            try:
                with pytest.raises(OutputError) as caught:
                    write(tmp_path)
            finally:
                resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
            assert "out.exr" in str(caught.value)
            assert "\n" not in str(caught.value)
            assert (tmp_path / "out.exr").read_bytes() == b"old"
            assert sorted(path.name for path in tmp_path.iterdir()) == ["in.exr", "out.exr"]
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("write", [written, annotated])
def test_a_folder_that_is_a_file_is_an_output_error(tmp_path: Path, write: Callable[[Path], None]) -> None:
    write_exr(tmp_path / "in.exr", plain_channels(3, 4))
    (tmp_path / "out.exr").mkdir()
    with pytest.raises(OutputError):
        write(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in.exr", "out.exr"]


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="this user may write everywhere")
def test_a_read_only_folder_is_an_output_error(tmp_path: Path) -> None:
    (tmp_path / "locked").mkdir(mode=0o500)
    with pytest.raises(OutputError):
        exr.write_picture(tmp_path / "locked" / "out.exr", picture(), {})


def test_annotating_keeps_every_channel_as_it_is(tmp_path: Path) -> None:
    channels = {**plain_channels(4, 5), "Object Index.X": np.arange(20, dtype=np.uint32).reshape(4, 5)}
    channels["A"] = channels["A"].astype(np.float16)
    channels["R"][1, 1] = np.nan
    window = {"dataWindow": box(2, 3, 6, 6), "displayWindow": box(0, 0, 9, 9)}
    write_exr(tmp_path / "in.exr", channels, **window, Camera="Camera", Note="kept")
    exr.annotate(tmp_path / "in.exr", tmp_path / "sub" / "out.exr", {"focus": 3.0, "potmesil:note": "{}"})
    part = OpenEXR.File(str(tmp_path / "sub" / "out.exr"), separate_channels=True).parts[0]
    assert sorted(part.channels) == sorted(channels)
    for name, values in channels.items():
        assert part.channels[name].pixels.dtype == values.dtype
        np.testing.assert_array_equal(part.channels[name].pixels, values)
    assert (part.header["focus"], part.header["potmesil:note"]) == (3.0, "{}")
    assert (part.header["Camera"], part.header["Note"]) == ("Camera", "kept")
    assert exr.read_samples(tmp_path / "sub" / "out.exr").data_window == Window(2, 3, 7, 7)
    assert [path.name for path in (tmp_path / "sub").iterdir()] == ["out.exr"]


@pytest.mark.parametrize("prefix", ["ViewLayer.", ""])
def test_annotating_keeps_the_parts(tmp_path: Path, prefix: str) -> None:
    multi_part(tmp_path / "in.exr", prefix)
    camera = Camera.from_format(np.eye(4), 50 * MM, FrameFormat(36 * MM, 24 * MM, 5, 4))
    exr.annotate(
        tmp_path / "in.exr", tmp_path / "out.exr", exr.camera_attributes(camera, LENS, ShutterAttributes())
    )
    check_passes(tmp_path / "out.exr")
    samples = exr.read_samples(tmp_path / "out.exr")
    assert samples.camera is not None
    assert samples.lens.f_stop == pytest.approx(2.8)
    assert exr.read_raw(tmp_path / "out.exr").parts == exr.read_raw(tmp_path / "in.exr").parts > 1


def test_annotating_parts_with_oblong_pixels(tmp_path: Path) -> None:
    """All parts of a file share its pixels' aspect, so one of them alone cannot change it."""
    multi_part(tmp_path / "in.exr", "ViewLayer.")
    camera = Camera.from_format(np.eye(4), 50 * MM, FrameFormat(36 * MM, 24 * MM, 5, 4, pixel_aspect_x=2.0))
    exr.annotate(
        tmp_path / "in.exr", tmp_path / "out.exr", exr.camera_attributes(camera, LENS, ShutterAttributes())
    )
    assert exr.read_samples(tmp_path / "out.exr").pixel_aspect == 2.0


def test_annotating_tiles(tmp_path: Path) -> None:
    tiled(tmp_path / "in.exr")
    exr.annotate(tmp_path / "in.exr", tmp_path / "out.exr", {"focus": 3.0})
    samples = exr.read_samples(tmp_path / "out.exr")
    assert samples.lens.focus_distance == 3.0
    assert samples.layers[0].depth is not None
    assert np.array_equal(samples.layers[0].depth, plain_channels(7, 10)["Z"])


def test_annotating_a_file_in_its_place(tmp_path: Path) -> None:
    path = write_exr(tmp_path / "a.exr", plain_channels(4, 5))
    exr.annotate(path, path, {"focus": 3.0})
    assert exr.read_samples(path).lens.focus_distance == 3.0
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"]


def test_annotating_nothing_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError):
        exr.annotate(tmp_path / "none.exr", tmp_path / "out.exr", {})
    assert not list(tmp_path.iterdir())


def test_film_of_a_file_covers_its_display_window(tmp_path: Path) -> None:
    """Overscan lies outside the film, as it lies outside the picture."""
    path = write_exr(
        tmp_path / "a.exr",
        plain_channels(8, 14),
        dataWindow=box(-2, -1, 11, 6),
        displayWindow=box(0, 0, 9, 5),
        sensorOverallDimensions=np.array([36.0, 21.6], dtype=np.float32),
    )
    film = exr.read_samples(path).film
    assert isinstance(film, Film)
    assert (film.columns, film.rows) == (10, 6)
    assert film.width == pytest.approx(36 * MM, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("potmesil:apertureBlades", 2**31 - 1),
        ("potmesil:apertureBlades", -5),
        ("potmesil:apertureRatio", 1e-30),
        ("potmesil:apertureRotation", 3e38),
        ("aperture", 1e-30),
        ("nominalFocalLength", 1e30),
        ("focus", 1e-30),
        ("expTime", 1e30),
        ("sensorOverallDimensions", np.array([1e38, 1e-38], dtype=np.float32)),
        ("sensorOverallDimensions", np.array([36.0, 1e-3], dtype=np.float32)),
    ],
)
def test_numbers_beyond_any_camera_count_as_not_said(tmp_path: Path, name: str, value: Any) -> None:
    """Some of them took all memory, or broke it, in processing."""
    samples = exr.read_samples(write_exr(tmp_path / "a.exr", plain_channels(4, 5), **{name: value}))
    assert samples.lens == LensAttributes()
    assert samples.film is None
    assert samples.shutter.exposure_time is None
