"""The command line: what it prints, what it writes, and how it ends."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import OpenEXR
import png as pypng
import pytest

from potmesil_addon import __version__, cli, exr, pictures
from potmesil_addon.camera import Camera, FrameFormat, camera_rotation
from potmesil_addon.errors import SettingsError
from potmesil_addon.lens import Lens, depth_of_field_for_circle
from potmesil_addon.paths import CameraPath, MotionPaths, ObjectPath
from potmesil_addon.process import ProcessSettings, process
from potmesil_addon.progress import run
from potmesil_addon.psf import PRIMARY_WAVELENGTHS, PsfSettings
from potmesil_addon.samples import LensAttributes
from potmesil_addon.shutter import Flash, Shutter, ShutterAttributes, Slit, attributes_from_json

from .helpers import (
    DATA,
    ROOT,
    box,
    data_files,
    diffraction_integral,
    ellipse_coverage,
    importable,
    needs_data,
    plain_channels,
    write_exr,
)

LENS = ["--focal-length", "50", "--fstop", "2.8", "--focus-distance", "3"]
SENSOR = ["--sensor-width", "36"]


class Ended:
    """How a run of the command line ended."""

    def __init__(self, status: int, out: str, err: str) -> None:
        self.status, self.out, self.err = status, out, err
        assert "Traceback" not in out + err
        assert status in (0, 2, 3, 4, 33)

    @property
    def json(self) -> Any:
        """What was printed, as strict JSON."""

        def refuse(token: str) -> NoReturn:
            raise AssertionError(f"{token} is no JSON")

        return json.loads(self.out, parse_constant=refuse)


Runner = Callable[..., Ended]


@pytest.fixture
def potmesil(capfd: pytest.CaptureFixture[str], all_threads: int) -> Runner:
    """Run the command line in this process, on copies of what it prints."""

    def runner(*arguments: object) -> Ended:
        capfd.readouterr()
        status = cli.main([str(argument) for argument in arguments])
        return Ended(status, *capfd.readouterr())

    return runner


def own_process(*arguments: object, cwd: Path = ROOT) -> Ended:
    """Run ``python -m potmesil_addon`` with all that it prints."""
    done = subprocess.run(
        [sys.executable, "-m", "potmesil_addon", *map(str, arguments)],
        cwd=cwd,
        env=importable(),
        capture_output=True,
        text=True,
        timeout=400,
        check=False,
    )
    return Ended(done.returncode, done.stdout, done.stderr)


def one_line(ended: Ended, status: int) -> str:
    """Return the one sentence of a run that failed."""
    assert ended.status == status, ended.err
    assert ended.err.endswith(".\n")
    assert ended.err.count("\n") == 1, ended.err
    assert ended.err.startswith("Error: ")
    return ended.err.strip()


def plain_file(folder: Path, name: str = "in.exr", rows: int = 8, columns: int = 12, **header: Any) -> Path:
    """Write samples that say nothing of a lens."""
    return write_exr(folder / name, plain_channels(rows, columns), **header)


def rendered_file(folder: Path, shutter: ShutterAttributes | None = None, **header: Any) -> Path:
    """Write samples with camera, lens and film; the camera at (1, 2, 3), panned 30 degrees, tilted -10."""
    shutter = shutter or ShutterAttributes(0.02, 24.0)
    to_camera = np.eye(4)
    to_camera[:3, :3] = camera_rotation(math.radians(30.0), math.radians(-10.0), math.radians(5.0))
    to_camera[:3, 3] = -to_camera[:3, :3] @ [1.0, 2.0, 3.0]
    camera = Camera.from_format(to_camera, 0.05, FrameFormat(1.2e-3, 0.8e-3, 12, 8))
    lens = Lens(0.05, 4.0, 3.5, 6, math.radians(10.0), 1.25)
    plain = plain_channels(8, 12)
    channels = {f"ViewLayer.Combined.{c}": plain[c] for c in "RGBA"}
    channels["ViewLayer.Depth.Z"] = plain["Z"]
    channels["ViewLayer.IndexOB.X"] = np.tile(np.array([0, 3, 7], dtype=np.float32), (8, 4))
    for component, length in zip("XYZW", (3.0, 4.0, 6.0, 8.0), strict=True):
        channels[f"ViewLayer.Vector.{component}"] = np.full((8, 12), length, dtype=np.float32)
    return write_exr(folder / "in.exr", channels, **exr.camera_attributes(camera, lens, shutter), **header)


def read_rgba(path: Path) -> Any:
    return OpenEXR.File(str(path)).channels()["RGBA"].pixels


def read_png(path: Path) -> Any:
    columns, rows, lines, info = pypng.Reader(filename=str(path)).read()
    return np.array([list(line) for line in lines]).reshape(rows, columns, info["planes"])


# dof


@pytest.mark.parametrize(
    ("f_stop", "focus", "far", "near"),
    [(5.6, 2000, 2511, 1662), (11, 550, 618, 495), (22, 2000, 10000, 1111), (22, 290, 328, 260)],
)
def test_dof_prints_table_1(potmesil: Runner, f_stop: float, focus: float, far: int, near: int) -> None:
    ended = potmesil(
        "dof", "--focal-length", 55, "--fstop", f_stop, "--focus-distance", focus / 1000, "--json"
    )
    assert (ended.status, ended.err) == (0, "")
    values = ended.json
    assert sorted(values) == ["depth_of_field_m", "far_m", "hyperfocal_m", "near_m"]
    assert values["hyperfocal_m"] == pytest.approx(55.0 / f_stop, rel=1e-12)
    assert round(values["far_m"] * 1000) == far
    assert round(values["near_m"] * 1000) == near
    assert values["depth_of_field_m"] == pytest.approx(values["far_m"] - values["near_m"], rel=1e-12)


@pytest.mark.parametrize("focus", ["20", "inf"])
def test_dof_prints_null_for_infinity(potmesil: Runner, focus: str) -> None:
    values = potmesil("dof", "--focal-length", 55, "--fstop", 5.6, "--focus-distance", focus, "--json").json
    assert values["far_m"] is None
    assert values["depth_of_field_m"] is None
    assert values["near_m"] == pytest.approx(55 / 5.6 if focus == "inf" else 20 * 55 / 5.6 / (20 + 55 / 5.6))


def test_dof_takes_another_criterion(potmesil: Runner) -> None:
    values = potmesil("dof", *LENS, "--criterion", 1500, "--json").json
    assert values["hyperfocal_m"] == pytest.approx(1500 * 0.05 / 2.8, rel=1e-12)


@pytest.mark.parametrize("model", ["cycles", "paper"])
def test_dof_takes_the_films_circle(potmesil: Runner, model: Any) -> None:
    values = potmesil("dof", *LENS, "--circle-mm", 0.03, "--coc-model", model, "--json").json
    limits = depth_of_field_for_circle(Lens(0.05, 2.8, 3.0), 3e-5, model)
    assert (values["near_m"], values["far_m"]) == pytest.approx((limits.near, limits.far), rel=1e-12)


def test_dof_prints_for_people(potmesil: Runner) -> None:
    ended = potmesil("dof", "--focal-length", 55, "--fstop", 11, "--focus-distance", 2)
    lines = [line.strip() for line in ended.out.splitlines()]
    assert lines == ["hyperfocal: 5 m", "near: 1.429 m", "far: 3.333 m", "depth of field: 1.905 m"]
    assert "infinity" in potmesil("dof", *LENS[:4], "--focus-distance", "inf").out


# psf


@pytest.mark.parametrize("depth", [1.0, 2.9, 3.0, 4.0, math.inf])
def test_psf_prints_the_papers_pattern(potmesil: Runner, depth: float) -> None:
    """u by TOG 1982, eq. 18 and the lens law, the circle by eq. 9, the intensity by quadrature."""
    ended = potmesil(
        "psf", "--focal-length", 50, "--fstop", 8, "--focus-distance", 3, "--depth", depth, "--json"
    )
    assert (ended.status, ended.err) == (0, "")
    values = ended.json
    k, d, f = 2.0 * math.pi / 549e-9, 0.05 / 8.0, 0.05
    plane = f * 3.0 / (3.0 - f)
    image = f if math.isinf(depth) else f * depth / (depth - f)
    u = k * (d / (2.0 * f)) ** 2 * (image - plane)
    assert values["u"] == pytest.approx(u, rel=1e-9, abs=1e-9)
    assert values["coc_mm"] == pytest.approx((plane - image) / image * d * 1000.0, rel=1e-9, abs=1e-12)
    assert values["wavelength_nm"] == pytest.approx(549.0)
    v, intensity = np.array(values["v"]), np.array(values["intensity"])
    assert v.shape == intensity.shape
    assert v[0] == 0.0
    assert (np.diff(v) > 0.0).all()
    reference = diffraction_integral(values["u"], v)
    assert np.abs(intensity - reference).max() < 1e-6 * reference.max()


def test_psf_profile_reaches_past_the_shadow_edge(potmesil: Runner) -> None:
    for model in ("cycles", "paper"):
        values = potmesil("psf", *LENS, "--depth", 4, "--coc-model", model, "--json").json
        edge = math.pi / (549e-9 * 2.8) * abs(values["coc_mm"]) * 1e-3 / 2.0
        assert values["v"][-1] >= max(abs(values["u"]), edge) + 30.0
        assert values["coc_model"] == model


@pytest.mark.parametrize("depth", [1.5, 7.0])
def test_psf_at_rest_has_u_at_the_circles_rim(potmesil: Runner, depth: float) -> None:
    values = potmesil("psf", *LENS, "--depth", depth, "--coc-model", "cycles", "--json").json
    circle = 0.05**2 / 2.8 * (1.0 / 3.0 - 1.0 / depth)
    assert values["coc_mm"] == pytest.approx(circle * 1000.0, rel=1e-9)
    # k (d/2F) (c/2), positive before the focus as in eq. 18.
    assert values["u"] == pytest.approx(-math.pi / (549e-9 * 2.8) * circle / 2.0, rel=1e-9)


def test_psf_takes_a_wavelength(potmesil: Runner) -> None:
    one = potmesil("psf", *LENS, "--depth", 4, "--json").json
    other = potmesil("psf", *LENS, "--depth", 4, "--wavelength-nm", 1098, "--json").json
    assert other["u"] == pytest.approx(one["u"] / 2.0, rel=1e-9)
    assert other["coc_mm"] == one["coc_mm"]


def test_psf_prints_for_people(potmesil: Runner) -> None:
    ended = potmesil("psf", *LENS, "--depth", 4)
    assert ended.status == 0
    assert ended.out.startswith("u = -")
    assert "circle of confusion 0.0756" in ended.out


def test_psf_writes_the_discs_table(potmesil: Runner, tmp_path: Path) -> None:
    # 0.05^2 / 2.8 (1/3 - 1/5) = 0.11905 mm: 11.905 pixels of 10 um.
    options = ["--depth", 5, "--coc-model", "cycles", "--psf", "disc", "--pixel-pitch-um", 10]
    ended = potmesil("psf", *LENS, *options, "-o", tmp_path / "out.exr")
    assert ended.status == 0
    table = read_rgba(tmp_path / "out.exr")
    radius = 0.05**2 / 2.8 * (1.0 / 3.0 - 1.0 / 5.0) / 10e-6 / 2.0
    expected = ellipse_coverage(radius, radius, 6, 0.5)
    assert table.shape == (13, 13, 4)
    for channel in range(3):
        np.testing.assert_allclose(table[..., channel], expected, atol=2e-6)
    assert (table[..., 3] == 1.0).all()


@pytest.mark.parametrize("model", ["cycles", "paper"])
def test_psf_writes_lommels_table_for_each_primary(potmesil: Runner, tmp_path: Path, model: str) -> None:
    options = ["--depth", 3.2, "--coc-model", model, "--pixel-pitch-um", 5]
    assert potmesil("psf", *LENS, *options, "-o", tmp_path / "out.exr").status == 0
    table = read_rgba(tmp_path / "out.exr")
    assert table.shape[0] == table.shape[1]
    assert table.shape[0] % 2 == 1
    np.testing.assert_allclose(table[..., :3].sum(axis=(0, 1)), 1.0, atol=1e-5)
    assert not np.array_equal(table[..., 0], table[..., 2])
    # One wavelength is one table for all.
    potmesil("psf", *LENS, *options, "--wavelength-nm", 500, "-o", tmp_path / "one.exr")
    table = read_rgba(tmp_path / "one.exr")
    assert np.array_equal(table[..., 0], table[..., 2])


def test_psf_writes_a_polygon_as_it_falls(potmesil: Runner, tmp_path: Path) -> None:
    # Three blades at -90 degrees point up behind the focus.
    options = [
        "--coc-model",
        "cycles",
        "--psf",
        "disc",
        "--blades",
        3,
        "--blade-rotation",
        -90,
        "--pixel-pitch-um",
        5,
    ]
    for depth, narrow, wide in ((5, 0, -1), (2.2, -1, 0)):
        potmesil("psf", *LENS, "--depth", depth, *options, "-o", tmp_path / "out.exr")
        rows = read_rgba(tmp_path / "out.exr")[..., 1]
        rows = rows[rows.sum(axis=1) > 1e-9]
        assert (rows[narrow] > 1e-9).sum() < (rows[wide] > 1e-9).sum() / 2


def test_psf_writes_a_16_bit_png(potmesil: Runner, tmp_path: Path) -> None:
    options = ["--depth", 5, "--coc-model", "cycles", "--psf", "disc", "--pixel-pitch-um", 10]
    potmesil("psf", *LENS, *options, "-o", tmp_path / "out.png")
    values = read_png(tmp_path / "out.png")
    assert values.shape == (13, 13, 3)
    assert values.max() == 65535
    assert values[6, 6, 0] == 65535


@pytest.mark.parametrize(
    "options",
    [
        ["-o", "out.exr"],
        ["--pixel-pitch-um", "10"],
        ["-o", "out.gif", "--pixel-pitch-um", "10"],
        ["-o", "out.exr", "--pixel-pitch-um", "0"],
        ["-o", "out.exr", "--pixel-pitch-um", "-3"],
        ["-o", "out.exr", "--pixel-pitch-um", "nan"],
        ["-o", "out.exr", "--pixel-pitch-um", "10", "--blades", "5"],
        ["--wavelength-nm", "0"],
        ["--wavelength-nm", "nan"],
        ["--depth", "0"],
        ["--depth", "-1"],
        ["--depth", "nan"],
        ["--depth", "0.05"],
        ["--focus-distance", "0.04"],
    ],
)
def test_psf_refuses(
    potmesil: Runner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    one_line(potmesil("psf", *LENS, "--depth", 4, *options), 2)
    assert not list(tmp_path.iterdir())


# info


def test_info_says_what_a_file_holds(potmesil: Runner, tmp_path: Path) -> None:
    ended = potmesil("info", rendered_file(tmp_path), "--json")
    assert (ended.status, ended.err) == (0, "")
    values = ended.json
    assert values["size"] == [12, 8]
    assert values["data_window"] == values["display_window"] == [0, 0, 12, 8]
    assert values["parts"] == 1
    assert {"ViewLayer.Combined", "ViewLayer.Depth", "ViewLayer.IndexOB", "ViewLayer.Vector"} == set(
        values["passes"]
    )
    assert "ViewLayer.Depth.Z" in values["channels"]
    (layer,) = values["layers"]
    depth = plain_channels(8, 12)["Z"]
    assert layer["name"] == "ViewLayer"
    assert layer["depth_m"] == pytest.approx([float(depth.min()), float(depth.max())])
    assert layer["without_surface"] == 0.0
    assert layer["objects"] == [0, 3, 7]
    assert layer["motion_px"] == pytest.approx([5.0, 10.0])
    lens = values["lens"]
    assert (lens["focal_length_mm"], lens["f_stop"], lens["focus_distance_m"]) == pytest.approx(
        (50.0, 4.0, 3.5)
    )
    assert lens["blades"] == 6
    assert values["film_mm"] == pytest.approx([1.2, 0.8])
    assert values["camera"]["position_m"] == pytest.approx([1.0, 2.0, 3.0], abs=1e-5)
    assert values["camera"]["pan_deg"] == pytest.approx(30.0, abs=1e-4)
    assert values["camera"]["tilt_deg"] == pytest.approx(-10.0, abs=1e-4)
    assert values["camera"]["swing_deg"] == pytest.approx(5.0, abs=1e-4)
    assert values["repaired"] == {}


FULL_SHUTTER = ShutterAttributes(
    0.02,
    25.0,
    frames=0.5,
    position="start",
    curve=((0.0, 0.0), (1.0, 1.0)),
    openings=((0.0, 0.2), (0.4, 1.2)),
    blade_time=0.25,
    slit=Slit("left", 0.125),
)


def test_info_says_what_the_shutter_does_and_what_moves(potmesil: Runner, tmp_path: Path) -> None:
    track = np.eye(3, 4)[np.newaxis] + np.arange(2.0)[:, np.newaxis, np.newaxis]
    times, cube = np.array([0.0, 0.5]), np.array([[-1.0] * 3, [1.0] * 3])
    paths = MotionPaths(
        CameraPath(times[:1], track[:1]),
        (
            ObjectPath("Ball", 3, times, track, cube),
            ObjectPath("Flag", 7, times[:1], track[:1], cube, deforming=True),
        ),
    )
    source = rendered_file(tmp_path, FULL_SHUTTER, **{"potmesil:motion": paths.to_json()})
    ended = potmesil("info", source, "--json")
    assert (ended.status, ended.err) == (0, "")
    assert ended.json["shutter"] == {
        "frames": 0.5,
        "exposure_time_s": pytest.approx(0.02),
        "position": "start",
        "curve": True,
        "openings": [[0.0, 0.2], [0.4, 1.2]],
        "blade_time": 0.25,
        "slit": {"edge": "left", "width": 0.125},
        "flash": None,
    }
    assert ended.json["motion"] == {"objects": 2, "deforming": 1, "camera_moves": False}
    text = potmesil("info", source).out
    lines = {line.split(":")[0].strip(): line for line in text.splitlines()}
    assert "frames 0.5" in lines["shutter"]
    assert "openings 0:0.2, 0.4:1.2" in text
    assert "slit edge left; width 0.125" in lines["shutter"]
    assert "objects 2; deforming 1; camera moves no" in lines["motion"]


def test_info_of_an_exposure_in_seconds(potmesil: Runner, tmp_path: Path) -> None:
    values = potmesil("info", rendered_file(tmp_path), "--json").json
    assert values["shutter"]["frames"] == pytest.approx(0.48)
    assert values["shutter"]["position"] is None
    assert values["shutter"]["slit"] is None
    assert values["shutter"]["curve"] is False
    assert values["motion"] is None


def test_info_names_companion_layers(potmesil: Runner, tmp_path: Path) -> None:
    channels = {}
    for name in ("View", "View (stationary)", "View (moving)", "Other"):
        for component, values in plain_channels(4, 6).items():
            pass_ = "Depth" if component == "Z" else "Combined"
            channels[f"{name}.{pass_}.{component}"] = values
    source = write_exr(tmp_path / "in.exr", channels)
    layers = {layer["name"]: layer for layer in potmesil("info", source, "--json").json["layers"]}
    assert sorted(layers) == ["Other", "View"]
    assert layers["View"]["companions"] == ["stationary", "moving"]
    assert layers["Other"]["companions"] == []
    assert "companions stationary, moving" in potmesil("info", source).out


def test_info_shows_names_that_a_terminal_would_obey(potmesil: Runner, tmp_path: Path) -> None:
    name = "\x1b[2JView"
    channels = {
        f"{name}.{'Depth' if component == 'Z' else 'Combined'}.{component}": values
        for component, values in plain_channels(4, 6).items()
    }
    said = potmesil("info", write_exr(tmp_path / "in.exr", channels)).out
    assert "\x1b" not in said
    assert "'\\x1b[2JView'" in said


def test_info_of_a_plain_file(potmesil: Runner, tmp_path: Path) -> None:
    channels = plain_channels(4, 5)
    channels["Z"][0] = np.inf
    channels["G"][1, 1] = np.nan
    write_exr(tmp_path / "in.exr", channels, dataWindow=box(2, 1, 6, 4), displayWindow=box(0, 0, 9, 5))
    values = potmesil("info", tmp_path / "in.exr", "--json").json
    assert values["size"] == [10, 6]
    assert values["data_window"] == [2, 1, 7, 5]
    assert values["camera"] is None
    assert values["film_mm"] is None
    assert values["lens"]["f_stop"] is None
    assert values["layers"][0]["without_surface"] == pytest.approx(0.25)
    assert values["layers"][0]["motion_px"] is None
    assert values["repaired"] == {"color": 1}


def test_info_describes_what_cannot_be_processed(potmesil: Runner, tmp_path: Path) -> None:
    write_exr(tmp_path / "in.exr", {"Normal.X": np.ones((3, 4), dtype=np.float32)})
    ended = potmesil("info", tmp_path / "in.exr", "--json")
    assert (ended.status, ended.err) == (0, "")
    assert ended.json["size"] == [4, 3]
    assert ended.json["channels"] == ["Normal.X"]
    assert "R, G, B" in ended.json["not_processable"]
    assert "R, G, B" in potmesil("info", tmp_path / "in.exr").out


def test_info_prints_for_people(potmesil: Runner, tmp_path: Path) -> None:
    ended = potmesil("info", rendered_file(tmp_path))
    assert ended.status == 0
    assert "size: 12, 8" in ended.out
    assert "ViewLayer" in ended.out
    assert "unknown" in potmesil("info", plain_file(tmp_path, "plain.exr")).out


@needs_data
@pytest.mark.parametrize("path", data_files("exr"), ids=lambda path: path.name)
def test_info_of_other_peoples_files(potmesil: Runner, path: Path) -> None:
    ended = potmesil("info", path, "--json")
    assert (ended.status, ended.err) == (0, "")
    assert ended.json["layers"]


# process


def test_process_writes_the_focused_picture(potmesil: Runner, tmp_path: Path) -> None:
    source = rendered_file(tmp_path)
    ended = potmesil("process", source, "-o", tmp_path / "out.exr")
    assert (ended.status, ended.err) == (0, "")
    assert f"Saved: '{tmp_path / 'out.exr'}'" in ended.out.splitlines()
    expected = run(process(exr.read_samples(source), ProcessSettings())).picture
    assert np.array_equal(read_rgba(tmp_path / "out.exr"), expected)


@pytest.mark.parametrize(
    ("options", "settings"),
    [
        (["--focal-length", "85"], {"lens": LensAttributes(focal_length=0.085)}),
        (["--fstop", "1.4"], {"lens": LensAttributes(f_stop=1.4)}),
        (["--focus-distance", "6"], {"lens": LensAttributes(focus_distance=6.0)}),
        (["--focus-distance", "inf"], {"lens": LensAttributes(focus_distance=math.inf)}),
        (["--blades", "0"], {"lens": LensAttributes(blades=0)}),
        (["--blade-rotation", "45"], {"lens": LensAttributes(blade_rotation=math.pi / 4)}),
        (["--anamorphic-ratio", "2"], {"lens": LensAttributes(anamorphic_ratio=2.0)}),
        (["--sensor-width", "2"], {"sensor_width": 0.002}),
        (["--sensor-height", "2"], {"sensor_height": 0.002}),
        (["--coc-model", "paper"], {"model": "paper"}),
        (["--weighting", "1981"], {"weighting": "1981"}),
        (["--lookup", "interpolated"], {"psf": PsfSettings(lookup="interpolated")}),
        (["--tables", "equal-z", "--table-step", "500"], {"psf": PsfSettings(tables="equal-z", step=0.5)}),
        (["--table-step", "3"], {"psf": PsfSettings(step=3.0)}),
        (["--no-lens"], {"use_lens": False}),
        (["--no-motion"], {"use_motion": False}),
        (["--shutter", "1.5"], {"shutter": ShutterAttributes(frames=1.5)}),
        (["--shutter-position", "end"], {"shutter": ShutterAttributes(position="end")}),
        (["--exposures", "2x0.1@0.8"], {"shutter": ShutterAttributes(openings=((0.0, 0.1), (0.8, 0.9)))}),
        (["--shutter-blades", "0.5"], {"shutter": ShutterAttributes(blade_time=0.5)}),
        (["--slit", "left:0.1"], {"shutter": ShutterAttributes(slit=Slit("left", 0.1))}),
    ],
)
def test_options_win_over_the_file(
    potmesil: Runner, tmp_path: Path, options: list[str], settings: dict[str, Any]
) -> None:
    source = rendered_file(tmp_path)
    assert potmesil("process", source, "-o", tmp_path / "out.exr", *options).status == 0
    samples = exr.read_samples(source)
    picture = read_rgba(tmp_path / "out.exr")
    assert np.array_equal(picture, run(process(samples, ProcessSettings(**settings))).picture)
    assert not np.array_equal(picture, run(process(samples, ProcessSettings())).picture)


def test_shutter_curve_option(potmesil: Runner, tmp_path: Path) -> None:
    source = rendered_file(tmp_path)
    out = tmp_path / "out.exr"
    name = curve_file(tmp_path, "[[0, 1], [0.5, 0], [1, 0]]")
    assert potmesil("process", source, "-o", out, "--shutter-curve", name).status == 0
    samples = exr.read_samples(source)
    wanted = ShutterAttributes(curve=((0.0, 1.0), (0.5, 0.0), (1.0, 0.0)))
    assert np.array_equal(read_rgba(out), run(process(samples, ProcessSettings(shutter=wanted))).picture)
    assert not np.array_equal(read_rgba(out), run(process(samples, ProcessSettings())).picture)


def test_none_takes_away_what_the_file_has(potmesil: Runner, tmp_path: Path) -> None:
    source = rendered_file(tmp_path, FULL_SHUTTER)
    off = ["--shutter-curve", "none", "--exposures", "none", "--shutter-blades", "0", "--slit", "none"]
    assert potmesil("process", source, "-o", tmp_path / "off.exr", *off).status == 0
    plain = rendered_file(tmp_path, ShutterAttributes(0.02, 25.0, frames=0.5, position="start"))
    assert potmesil("process", plain, "-o", tmp_path / "plain.exr").status == 0
    assert np.array_equal(read_rgba(tmp_path / "off.exr"), read_rgba(tmp_path / "plain.exr"))


@pytest.mark.parametrize(
    ("options", "status", "word"),
    [(["--shutter", "1"], 3, "Vector"), (["--shutter-position", "end"], 2, "--shutter")],
)
def test_a_shutter_needs_its_length_and_something_that_moves(
    potmesil: Runner, tmp_path: Path, options: list[str], status: int, word: str
) -> None:
    arguments = ["process", plain_file(tmp_path), "-o", tmp_path / "out.exr", *LENS, *SENSOR]
    assert word in one_line(potmesil(*arguments, *options), status)
    assert potmesil(*arguments, *options, "--no-motion").status == 0


def test_lommel_option(potmesil: Runner, tmp_path: Path) -> None:
    source = rendered_file(tmp_path)
    assert (
        potmesil("process", source, "-o", tmp_path / "out.exr", "--psf", "lommel", "--blades", 0).status == 0
    )
    settings = ProcessSettings(lens=LensAttributes(blades=0), psf=PsfSettings(kind="lommel"))
    expected = run(process(exr.read_samples(source), settings)).picture
    assert np.array_equal(read_rgba(tmp_path / "out.exr"), expected)


def test_backends_and_threads_give_one_picture(potmesil: Runner, tmp_path: Path) -> None:
    source = rendered_file(tmp_path)
    pictures = []
    for options in ([], ["--threads", "1"], ["--threads", "99"], ["--backend", "numpy"]):
        assert potmesil("process", source, "-o", tmp_path / "out.exr", *options).status == 0
        pictures.append(read_rgba(tmp_path / "out.exr"))
    assert np.array_equal(pictures[0], pictures[1])
    assert np.array_equal(pictures[0], pictures[2])
    assert np.abs(pictures[0] - pictures[3]).max() < 1e-6


@pytest.mark.parametrize(
    ("left_out", "option"),
    [(0, "--focal-length"), (2, "--fstop"), (4, "--focus-distance"), (6, "--sensor-width")],
)
def test_what_nobody_says_is_named(potmesil: Runner, tmp_path: Path, left_out: int, option: str) -> None:
    source = plain_file(tmp_path)
    complete = [*LENS, *SENSOR]
    options = complete[:left_out] + complete[left_out + 2 :]
    assert option in one_line(potmesil("process", source, "-o", tmp_path / "out.exr", *options), 2)
    assert not (tmp_path / "out.exr").exists()
    assert potmesil("process", source, "-o", tmp_path / "out.exr", *complete).status == 0


def test_the_result_says_how_it_was_made(potmesil: Runner, tmp_path: Path) -> None:
    potmesil(
        "process",
        rendered_file(tmp_path),
        "-o",
        tmp_path / "out.exr",
        "--fstop",
        1.4,
        "--focus-distance",
        "inf",
    )
    header = OpenEXR.File(str(tmp_path / "out.exr"), header_only=True).parts[0].header
    # Its own lens in place of the file's.
    assert header["aperture"] == pytest.approx(1.4)
    assert header["focus"] == math.inf
    assert header["nominalFocalLength"] == pytest.approx(50.0)
    assert json.loads(header["potmesil:lens"])["f_stop"] == 1.4
    # The camera carried on.
    assert header["expTime"] == pytest.approx(0.02)
    source = OpenEXR.File(str(tmp_path / "in.exr"), header_only=True).parts[0].header
    for name in ("worldToCamera", "worldToNDC", "sensorOverallDimensions"):
        assert np.array_equal(header[name], source[name])


def test_the_result_covers_the_display_window(potmesil: Runner, tmp_path: Path) -> None:
    plain_file(tmp_path, dataWindow=box(-2, -1, 9, 6), displayWindow=box(1, 2, 8, 5), pixelAspectRatio=2.0)
    assert potmesil("process", tmp_path / "in.exr", "-o", tmp_path / "out.exr", *LENS, *SENSOR).status == 0
    part = OpenEXR.File(str(tmp_path / "out.exr")).parts[0]
    for name in ("dataWindow", "displayWindow"):
        assert [corner.tolist() for corner in part.header[name]] == [[1, 2], [8, 5]]
    assert part.header["pixelAspectRatio"] == 2.0
    assert part.channels["RGBA"].pixels.shape == (4, 8, 4)


def lit_corner_file(folder: Path) -> Path:
    """Write a picture whose pixel in the second row, third column is red, all in focus."""
    channels = {name: np.zeros((4, 6), dtype=np.float32) for name in "RGB"}
    channels["R"][1, 2] = 1.0
    channels["A"] = np.ones((4, 6), dtype=np.float32)
    channels["Z"] = np.full((4, 6), 3.0, dtype=np.float32)
    return write_exr(folder / "in.exr", channels)


def test_rows_and_columns_keep_their_places(potmesil: Runner, tmp_path: Path) -> None:
    lit_corner_file(tmp_path)
    for name in ("out.exr", "out.png"):
        assert potmesil("process", tmp_path / "in.exr", "-o", tmp_path / name, *LENS, *SENSOR).status == 0
    assert np.argwhere(read_rgba(tmp_path / "out.exr")[..., 0] > 0.5).tolist() == [[1, 2]]
    values = read_png(tmp_path / "out.png")
    assert values.shape == (4, 6, 3)
    assert np.argwhere(values[..., 0] > 127).tolist() == [[1, 2]]
    assert values[1, 2].tolist() == [255, 0, 0]


def test_png_has_straight_alpha(potmesil: Runner, tmp_path: Path) -> None:
    channels = plain_channels(4, 6)
    for name in "RGBA":
        channels[name][:] = 0.5
    write_exr(tmp_path / "in.exr", channels)
    potmesil("process", tmp_path / "in.exr", "-o", tmp_path / "out.png", *LENS, *SENSOR)
    values = read_png(tmp_path / "out.png")
    assert values.shape == (4, 6, 4)
    assert (values == [255, 255, 255, 128]).all()


@pytest.mark.parametrize("options", [[], ["--no-blocks"]])
def test_blocks_are_a_choice(potmesil: Runner, tmp_path: Path, options: list[str]) -> None:
    report = tmp_path / "report.json"
    source = rendered_file(tmp_path)
    assert potmesil("process", source, "-o", tmp_path / "out.exr", "--report", report, *options).status == 0
    assert json.loads(report.read_text(encoding="utf-8"))["lens"]["blocks"] is (not options)


def test_report_is_strict_json(potmesil: Runner, tmp_path: Path) -> None:
    channels = plain_channels(8, 12)
    channels["Z"][:] = np.inf
    channels["R"][2, 2] = np.nan
    write_exr(tmp_path / "in.exr", channels)
    options = [*LENS, *SENSOR, "--report", tmp_path / "sub" / "report.json"]
    ended = potmesil("process", tmp_path / "in.exr", "-o", tmp_path / "out.exr", *options)
    assert ended.status == 0
    assert "Repaired 1 color" in ended.out
    text = (tmp_path / "sub" / "report.json").read_text(encoding="utf-8")
    report = Ended(0, text, "").json
    assert report["input"] == str(tmp_path / "in.exr")
    assert report["output"] == str(tmp_path / "out.exr")
    assert report["size"] == [12, 8]
    assert report["repaired"] == {"color": 1}
    # Nothing has a finite depth.
    assert report["focus"][0]["nearest_m"] is None
    assert report["focus"][0]["tables"] == 1
    assert report["lens"]["f_stop"] == 2.8
    assert report["mask"] is None
    assert report["shutter"] is None
    assert report["motion"] == []
    assert report["threads"] >= 1
    assert report["seconds"] > 0.0


def test_report_says_what_the_shutter_and_the_paths_were(potmesil: Runner, tmp_path: Path) -> None:
    report = tmp_path / "report.json"
    arguments = ["process", rendered_file(tmp_path), "-o", tmp_path / "out.exr", "--report", report]
    assert potmesil(*arguments, "--mask", tmp_path / "mask.png", "--slit", "right:0.5").status == 0
    values = Ended(0, report.read_text(encoding="utf-8"), "").json
    assert values["mask"] == str(tmp_path / "mask.png")
    assert values["shutter"]["frames"] == pytest.approx(0.48)
    assert values["shutter"]["slit"] == {"edge": "right", "width": 0.5}
    (layer,) = values["motion"]
    assert layer["layer"] == "ViewLayer"
    assert layer["instants"] > 0


def test_missing_output_folder_is_made(potmesil: Runner, tmp_path: Path) -> None:
    path = tmp_path / "a" / "b" / "out.exr"
    assert potmesil("process", rendered_file(tmp_path), "-o", path).status == 0
    assert [p.name for p in path.parent.iterdir()] == ["out.exr"]


@pytest.mark.parametrize("name", ["out.EXR", "out.PNG"])
def test_endings_may_be_in_capitals(potmesil: Runner, tmp_path: Path, name: str) -> None:
    assert potmesil("process", lit_corner_file(tmp_path), "-o", tmp_path / name, *LENS, *SENSOR).status == 0
    magic = (tmp_path / name).read_bytes()[:4]
    assert magic == (b"\x76\x2f\x31\x01" if name.endswith("EXR") else b"\x89PNG")


def layered_file(folder: Path) -> Path:
    channels = {}
    for name, depth in (("far", 8.0), ("near", 2.0)):
        for component, values in plain_channels(4, 6, seed=int(depth)).items():
            pass_ = "Depth" if component == "Z" else "Combined"
            channels[f"{name}.{pass_}.{component}"] = (
                np.full_like(values, depth) if component == "Z" else values
            )
    return write_exr(folder / "in.exr", channels)


def test_layer_option_takes_layers(potmesil: Runner, tmp_path: Path) -> None:
    source = layered_file(tmp_path)
    out = tmp_path / "out.exr"
    pictures = {}
    for layer in ("far", "near"):
        assert potmesil("process", source, "-o", out, "--no-lens", "--layer", layer).status == 0
        pictures[layer] = read_rgba(out)
    np.testing.assert_array_equal(pictures["far"][..., 0], plain_channels(4, 6, seed=8)["R"])
    # Both are opaque, so the near one is all that is seen.
    assert (
        potmesil("process", source, "-o", out, "--no-lens", "--layer", "far", "--layer", "near").status == 0
    )
    assert np.array_equal(read_rgba(out), pictures["near"])
    assert "'far', 'near'" in one_line(potmesil("process", source, "-o", out, "--layer", "fog"), 3)


@needs_data
def test_process_of_another_programs_file(potmesil: Runner, tmp_path: Path) -> None:
    source = DATA / "exr" / "cube0001.exr"
    ended = potmesil("process", source, "-o", tmp_path / "out.png", *LENS, *SENSOR)
    assert (ended.status, ended.err) == (0, "")
    assert read_png(tmp_path / "out.png").shape == (270, 480, 3)


# The shutter


def parsed(*options: str) -> ProcessSettings:
    """Return the settings of ``process`` with these options."""
    arguments = ["process", "in.exr", "-o", "out.exr", *options]
    return cli.process_settings(cli.build_parser("potmesil").parse_args(arguments))


def curve_file(folder: Path, text: str) -> str:
    path = folder / "curve.json"
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.mark.parametrize(
    ("options", "shutter"),
    [
        ([], ShutterAttributes()),
        (["--shutter", "0.75"], ShutterAttributes(frames=0.75)),
        (["--shutter", "0"], ShutterAttributes(frames=0.0)),
        (["--shutter-position", "end"], ShutterAttributes(position="end")),
        (["--shutter-curve", "none"], ShutterAttributes(curve=())),
        (["--exposures", "0:0.2,0.4:0.6"], ShutterAttributes(openings=((0.0, 0.2), (0.4, 0.6)))),
        (["--exposures", "2x0.2@0.4"], ShutterAttributes(openings=((0.0, 0.2), (0.4, 0.6)))),
        (["--exposures", "none"], ShutterAttributes(openings=())),
        (["--shutter-blades", "0.25"], ShutterAttributes(blade_time=0.25)),
        (["--shutter-blades", "0"], ShutterAttributes(blade_time=0.0)),
        (["--slit", "left:0.1"], ShutterAttributes(slit=Slit("left", 0.1))),
        (["--slit", "bottom:0"], ShutterAttributes(slit=Slit("bottom", 0.0))),
        (["--slit", "none"], ShutterAttributes(slit=Slit(width=1.0))),
    ],
)
def test_shutter_options_become_attributes(options: list[str], shutter: ShutterAttributes) -> None:
    assert parsed(*options).shutter == shutter


def test_motion_options_become_settings() -> None:
    assert (parsed().use_motion, parsed().motion_model) == (True, "auto")
    settings = parsed("--no-motion", "--motion-model", "vector")
    assert (settings.use_motion, settings.motion_model) == (False, "vector")
    assert settings.use_lens


@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_shutter_curve_is_read_from_its_file(tmp_path: Path, mark: str) -> None:
    name = curve_file(tmp_path, mark + "[[0, 0], [0.5, 1], [1, 0.25]]")
    assert parsed("--shutter-curve", name).shutter.curve == ((0.0, 0.0), (0.5, 1.0), (1.0, 0.25))


def test_options_switch_off_what_the_file_has() -> None:
    off = parsed("--shutter-curve", "none", "--exposures", "none", "--shutter-blades", "0", "--slit", "none")
    shutter = off.shutter.over(FULL_SHUTTER).resolve()
    plain = Shutter(0.5, "start")
    assert shutter is not None
    assert (shutter.curve, shutter.openings, shutter.blade_time) == ((), (), 0.0)
    assert shutter.interval == plain.interval
    # A slit as wide as the film exposes all of it at once.
    along = np.linspace(0.0, 1.0, 5)
    for position in (0.0, 0.3, 1.0):
        np.testing.assert_allclose(
            shutter.frame_times(position, along), float(plain.frame_times(position)), atol=1e-15
        )


@pytest.mark.parametrize(
    "options",
    [
        ["--shutter", "-1"],
        ["--shutter", "nan"],
        ["--shutter", "inf"],
        ["--exposures", ""],
        ["--exposures", "0.2"],
        ["--exposures", "0:0.4,0.2:0.6"],
        ["--exposures", "0.4:0.2"],
        ["--exposures", "0:inf"],
        ["--exposures", "5x0.4@0.2"],
        ["--exposures", "0x0.2@0.4"],
        ["--shutter-blades", "-0.1"],
        ["--shutter-blades", "0.6"],
        ["--shutter-blades", "nan"],
        ["--slit", "left"],
        ["--slit", "0.1"],
        ["--slit", "left:wide"],
        ["--slit", "left:1.5"],
        ["--slit", "left:nan"],
        ["--slit", "middle:0.5"],
        ["--slit", ""],
    ],
)
def test_shutters_out_of_range_are_2_before_any_work(
    potmesil: Runner, tmp_path: Path, options: list[str]
) -> None:
    # Not even the input is looked for.
    one_line(potmesil("process", tmp_path / "none.exr", "-o", tmp_path / "out.exr", *options), 2)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[[0, 1]]",
        "[[0, 1], [1, 2]]",
        "[[1, 1], [0, 1]]",
        "[[0, 0], [1, 0]]",
        "[1, 2]",
        "\0\0",
        "null",
    ],
)
def test_wrong_shutter_curve_is_2(potmesil: Runner, tmp_path: Path, text: str) -> None:
    name = curve_file(tmp_path, text)
    source = plain_file(tmp_path)
    one_line(potmesil("process", source, "-o", tmp_path / "out.exr", "--shutter-curve", name), 2)


def test_binary_shutter_curve_is_2(potmesil: Runner, tmp_path: Path) -> None:
    (tmp_path / "curve.json").write_bytes(bytes(range(256)))
    arguments = ["process", "in.exr", "-o", "out.exr", "--shutter-curve", tmp_path / "curve.json"]
    one_line(potmesil(*arguments), 2)


@pytest.mark.parametrize("name", ["missing.json", "."])
def test_missing_shutter_curve_is_3(potmesil: Runner, tmp_path: Path, name: str) -> None:
    arguments = ["process", plain_file(tmp_path), "-o", tmp_path / "out.exr"]
    assert name in one_line(potmesil(*arguments, "--shutter-curve", tmp_path / name), 3)


@pytest.mark.parametrize("option", ["--shutter", "--shutter-position", "--motion-model", "--shutter-blades"])
def test_wrong_words_of_the_shutter_are_usage(potmesil: Runner, option: str) -> None:
    ended = potmesil("process", "in.exr", "-o", "out.exr", option, "sideways")
    assert ended.status == 2
    assert "usage:" in ended.err


def written_header(folder: Path, samples: Any, settings: ProcessSettings) -> dict[str, Any]:
    pictures.write_result(folder / "out.exr", run(process(samples, settings)), samples)
    header: dict[str, Any] = OpenEXR.File(str(folder / "out.exr"), header_only=True).parts[0].header
    return header


def test_the_result_carries_the_shutter_that_was_used(tmp_path: Path) -> None:
    samples = exr.read_samples(rendered_file(tmp_path, FULL_SHUTTER))
    wanted = ShutterAttributes(frames=2.0, curve=(), slit=Slit("top", 0.5))
    header = written_header(tmp_path, samples, ProcessSettings(shutter=wanted))
    used = attributes_from_json(json.loads(header["potmesil:shutter"]))
    assert used == ShutterAttributes(
        frames=2.0,
        position="start",
        openings=((0.0, 0.2), (0.4, 1.2)),
        blade_time=0.25,
        slit=Slit("top", 0.5),
    )
    assert header["expTime"] == pytest.approx(2.0 / 25.0)
    # What was read back is the same shutter again.
    assert exr.read_samples(tmp_path / "out.exr").shutter.resolve() == wanted.over(FULL_SHUTTER).resolve()


def test_a_result_without_motion_says_nothing_of_a_shutter(tmp_path: Path) -> None:
    samples = exr.read_samples(rendered_file(tmp_path, FULL_SHUTTER))
    wanted = ShutterAttributes(frames=2.0)
    header = written_header(tmp_path, samples, ProcessSettings(use_motion=False, shutter=wanted))
    assert "potmesil:shutter" not in header
    assert header["expTime"] == pytest.approx(0.02)


def guessed_result(samples: Any) -> tuple[Any, Any]:
    """Return a result, and the mask of what was guessed in it."""
    result = run(process(samples, ProcessSettings(use_motion=False)))
    mask = np.linspace(0.0, 1.0, result.picture[..., 0].size, dtype=np.float32)
    mask = mask.reshape(result.picture.shape[:2])
    return replace(result, guessed=mask), mask


def test_mask_is_grey(tmp_path: Path) -> None:
    samples = exr.read_samples(rendered_file(tmp_path))
    result, mask = guessed_result(samples)
    pictures.write_map(tmp_path / "mask.exr", result.guessed, result, samples)
    written = read_rgba(tmp_path / "mask.exr")
    for channel in range(3):
        assert np.array_equal(written[..., channel], mask)
    assert (written[..., 3] == 1.0).all()
    pictures.write_map(tmp_path / "mask.png", result.guessed, result, samples)
    values = read_png(tmp_path / "mask.png")
    assert values.shape == (*mask.shape, 3)
    assert (values[0, 0, 0], values[-1, -1, 0]) == (0, 255)
    assert (np.diff(values[..., 0].ravel().astype(int)) >= 0).all()


def test_mask_lies_where_the_picture_does(potmesil: Runner, tmp_path: Path) -> None:
    source = plain_file(tmp_path, dataWindow=box(-2, -1, 9, 6), displayWindow=box(1, 2, 8, 5))
    arguments = ["process", source, "-o", tmp_path / "out.exr", *LENS, *SENSOR, "--mask", tmp_path / "m.exr"]
    assert potmesil(*arguments).status == 0
    picture, mask = (OpenEXR.File(str(tmp_path / name)).parts[0] for name in ("out.exr", "m.exr"))
    for name in ("dataWindow", "displayWindow"):
        assert [c.tolist() for c in mask.header[name]] == [c.tolist() for c in picture.header[name]]
    # Nothing moves, so nothing was guessed.
    assert (mask.channels["RGBA"].pixels[..., :3] == 0.0).all()


def test_error_map_and_report_say_how_sure_the_picture_is(potmesil: Runner, tmp_path: Path) -> None:
    source, report = rendered_file(tmp_path), tmp_path / "r.json"
    arguments = ["process", source, "-o", tmp_path / "o.exr", "--error-map", tmp_path / "e.exr"]
    assert potmesil(*arguments, "--report", report).status == 0
    error = read_rgba(tmp_path / "e.exr")
    assert error.shape == read_rgba(tmp_path / "o.exr").shape
    assert error[..., :3].min() >= 0.0
    quality = json.loads(report.read_text())["quality"]
    assert quality["predicted_error"] == pytest.approx(float(np.sqrt((error[..., 0] ** 2).mean())), rel=1e-5)
    assert 0.0 <= quality["guessed_light"] <= 1.0
    assert 0.0 <= quality["guessed_pixels"] <= 1.0


@pytest.mark.parametrize("visibility", ["aperture", "none"])
def test_visibility_is_chosen_and_reported(potmesil: Runner, tmp_path: Path, visibility: str) -> None:
    source, report = rendered_file(tmp_path), tmp_path / "r.json"
    words = () if visibility == "aperture" else ("--visibility", visibility)
    ended = potmesil("process", source, "-o", tmp_path / "o.exr", "--report", report, *words)
    assert ended.status == 0, ended.err
    assert json.loads(report.read_text())["lens"]["visibility"] == visibility


def test_error_map_replaces_nothing(potmesil: Runner, tmp_path: Path) -> None:
    source = rendered_file(tmp_path)
    for other in ("o.exr", "m.exr"):
        words = ("-o", tmp_path / "o.exr", "--mask", tmp_path / "m.exr", "--error-map", tmp_path / other)
        one_line(potmesil("process", source, *words), 2)
        assert not (tmp_path / "o.exr").exists()


@pytest.mark.parametrize("name", ["in.exr", "out.exr", "mask.jpg"])
def test_mask_replaces_nothing(potmesil: Runner, tmp_path: Path, name: str) -> None:
    source = plain_file(tmp_path)
    before = source.read_bytes()
    arguments = ["process", source, "-o", tmp_path / "out.exr", *LENS, *SENSOR, "--mask", tmp_path / name]
    one_line(potmesil(*arguments), 2)
    assert source.read_bytes() == before
    assert not (tmp_path / "out.exr").exists()


# How it ends


# sequences


def sequence(folder: Path, *frames: int) -> Path:
    """Write frames of samples, each file the same; return their template."""
    folder.mkdir(exist_ok=True)
    first = rendered_file(folder)
    for frame in frames:
        (folder / f"s.{frame:04d}.exr").write_bytes(first.read_bytes())
    return folder / "s.####.exr"


def test_a_sequence_is_processed_frame_by_frame(potmesil: Runner, tmp_path: Path) -> None:
    template = sequence(tmp_path / "in", 1, 2, 5)
    output, report = tmp_path / "o.####.exr", tmp_path / "r.json"
    ended = potmesil("process", template, "-o", output, "--report", report)
    assert ended.status == 0, ended.err
    assert ended.out.count("Saved: ") == 3
    for frame in (1, 2, 5):
        assert (tmp_path / f"o.{frame:04d}.exr").is_file()
        assert f"s.{frame:04d}.exr" in json.loads((tmp_path / f"r{frame:04d}.json").read_text())["input"]


def test_frames_choose_and_the_focus_is_pulled(potmesil: Runner, tmp_path: Path) -> None:
    template = sequence(tmp_path / "in", 1, 2, 3, 4)
    ended = potmesil(
        "process", template, "-o", tmp_path / "o.exr", "--frames", "1-3",
        "--focus-distance", "1=1,3=0.5", "--fstop", "1=2,3=8", "--report", tmp_path / "r.json",
    )  # fmt: skip
    assert ended.status == 0, ended.err
    assert not (tmp_path / "o0004.exr").exists()
    reports = [json.loads((tmp_path / f"r{frame:04d}.json").read_text())["lens"] for frame in (1, 2, 3)]
    assert [lens["focus_distance_m"] for lens in reports] == pytest.approx([1.0, 2.0 / 3.0, 0.5])
    assert [lens["f_stop"] for lens in reports] == pytest.approx([2.0, 4.0, 8.0])


def test_one_samples_file_becomes_an_animation(potmesil: Runner, tmp_path: Path) -> None:
    still = rendered_file(tmp_path)
    words = ("--frames", "1-3", "--no-motion", "--fade", "1=0,3=1")
    assert potmesil("process", still, "-o", tmp_path / "o.####.exr", *words).status == 0
    black, half, full = (read_rgba(tmp_path / f"o.{frame:04d}.exr") for frame in (1, 2, 3))
    assert not black[..., :3].any()
    np.testing.assert_allclose(half[..., :3], 0.5 * full[..., :3], rtol=1e-6)
    np.testing.assert_array_equal(black[..., 3], full[..., 3])


def test_uniform_defocus_is_a_diameter_on_the_film(potmesil: Runner, tmp_path: Path) -> None:
    still = rendered_file(tmp_path)
    words = ("--no-lens", "--no-motion")
    potmesil("process", still, "-o", tmp_path / "sharp.exr", *words)
    potmesil("process", still, "-o", tmp_path / "soft.exr", *words, "--uniform-defocus", "0.4")
    samples = exr.read_samples(still)
    settings = ProcessSettings(use_lens=False, use_motion=False, uniform_defocus=0.4e-3)
    expected = run(process(samples, settings)).picture
    np.testing.assert_array_equal(read_rgba(tmp_path / "soft.exr"), expected)
    assert np.abs(expected - read_rgba(tmp_path / "sharp.exr")).max() > 0.01


def test_a_gap_in_a_sequence_is_3(potmesil: Runner, tmp_path: Path) -> None:
    template = sequence(tmp_path / "in", 1, 3)
    line = one_line(potmesil("process", template, "-o", tmp_path / "o.exr", "--frames", "1-3"), 3)
    assert "s.0002.exr" in line


def test_a_sequence_without_frames_is_3(potmesil: Runner, tmp_path: Path) -> None:
    line = one_line(potmesil("process", tmp_path / "s.####.exr", "-o", tmp_path / "o.exr"), 3)
    assert "s.####.exr" in line


@pytest.mark.parametrize(
    "words",
    [
        ("--fade", "1=0,2=1"),
        ("--fade", "-1"),
        ("--fade", "1=1,2=-1", "--frames", "1-2"),
        ("--fade", "x"),
        ("--uniform-defocus", "inf"),
        ("--focus-distance", "2=1,1=2"),
        ("--fstop", "1=2,8", "--frames", "1"),
        ("--frames", "5-1"),
    ],
)
def test_wrong_keys_are_2_before_any_work(potmesil: Runner, tmp_path: Path, words: tuple[str, ...]) -> None:
    still = rendered_file(tmp_path)
    one_line(potmesil("process", still, "-o", tmp_path / "o.exr", *words), 2)
    assert list(tmp_path.glob("o*")) == []


def test_no_frame_replaces_its_samples(potmesil: Runner, tmp_path: Path) -> None:
    template = sequence(tmp_path / "in", 1, 2)
    line = one_line(potmesil("process", template, "-o", tmp_path / "in" / "s.####.exr"), 2)
    assert "replace the samples file" in line
    # Nor those of another frame: the mask of frame 1 would be the samples of frame 11.
    template = sequence(tmp_path / "in", 1, 11)
    words = ("--frames", "1,11", "--mask", tmp_path / "in" / "s.001#.exr")
    assert "replace the samples file" in one_line(
        potmesil("process", template, "-o", tmp_path / "o.exr", *words), 2
    )


@pytest.mark.parametrize("command", ["info", "process"])
def test_missing_input_is_3(potmesil: Runner, tmp_path: Path, command: str) -> None:
    more = ["-o", tmp_path / "out.exr", *LENS, *SENSOR] if command == "process" else []
    assert "none.exr" in one_line(potmesil(command, tmp_path / "none.exr", *more), 3)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", ["info", "process"])
def test_damaged_input_is_3_with_one_line(potmesil: Runner, tmp_path: Path, command: str) -> None:
    data = rendered_file(tmp_path).read_bytes()
    bad = tmp_path / "bad.exr"
    more = ["-o", tmp_path / "out.exr", *LENS, *SENSOR] if command == "process" else []
    for content in (b"", b"no picture\n", data[:100], data[: len(data) // 2], data[:-1]):
        bad.write_bytes(content)
        assert "bad.exr" in one_line(potmesil(command, bad, *more), 3)
    one_line(potmesil(command, tmp_path, *more), 3)
    assert not (tmp_path / "out.exr").exists()


@needs_data
@pytest.mark.parametrize("path", data_files("exr-damaged"), ids=lambda path: path.name[-24:])
def test_files_from_fuzzers_are_3_with_one_line(potmesil: Runner, path: Path) -> None:
    one_line(potmesil("info", path), 3)


def test_input_without_depth_is_3(potmesil: Runner, tmp_path: Path) -> None:
    channels = plain_channels(4, 5)
    del channels["Z"]
    write_exr(tmp_path / "in.exr", channels)
    arguments = ["process", tmp_path / "in.exr", "-o", tmp_path / "out.exr"]
    assert "depth" in one_line(potmesil(*arguments, *LENS, *SENSOR), 3)
    assert potmesil(*arguments, "--no-lens").status == 0


@pytest.mark.parametrize(
    "options",
    [
        ["--fstop", "0"],
        ["--fstop", "nan"],
        ["--focal-length", "-50"],
        ["--focus-distance", "0"],
        ["--blades", "-1"],
        ["--blade-rotation", "inf"],
        ["--anamorphic-ratio", "0"],
        ["--sensor-width", "0"],
        ["--sensor-height", "nan", "--sensor-width", "nan"],
        ["--table-step", "0"],
        ["--table-step", "nan"],
        ["--tables", "equal-z", "--table-step", "-1"],
        ["--coc-model", "paper", "--focus-distance", "0.01"],
        ["--psf", "lommel", "--blades", "5"],
    ],
)
def test_values_out_of_range_are_2_with_one_line(
    potmesil: Runner, tmp_path: Path, options: list[str]
) -> None:
    source = plain_file(tmp_path)
    one_line(potmesil("process", source, "-o", tmp_path / "out.exr", *LENS, *SENSOR, *options), 2)
    assert not (tmp_path / "out.exr").exists()


@pytest.mark.parametrize("name", ["out.jpg", "out", "out.exr.txt"])
def test_other_endings_are_2_before_any_work(potmesil: Runner, tmp_path: Path, name: str) -> None:
    source = plain_file(tmp_path)
    assert name in one_line(potmesil("process", source, "-o", tmp_path / name, *LENS, *SENSOR), 2)
    assert [path.name for path in tmp_path.iterdir()] == ["in.exr"]


def test_the_samples_file_is_never_replaced(potmesil: Runner, tmp_path: Path) -> None:
    source = plain_file(tmp_path)
    before = source.read_bytes()
    (tmp_path / "sub").mkdir()
    for target in (source, tmp_path / "sub" / ".." / "in.exr"):
        one_line(potmesil("process", source, "-o", target, *LENS, *SENSOR), 2)
    assert source.read_bytes() == before


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["nothing"],
        ["dof"],
        ["dof", "--fstop", "2.8"],
        ["dof", *LENS, "--no-such-option"],
        ["dof", *LENS, "--fstop", "wide"],
        ["dof", *LENS, "--criterion", "1000", "--circle-mm", "0.03"],
        ["psf", *LENS],
        ["psf", *LENS, "--depth", "4", "--coc-model", "other"],
        ["info"],
        ["process", "in.exr"],
        ["process", "-o", "out.exr"],
        ["process", "in.exr", "-o", "out.exr", "--psf", "other"],
        ["process", "in.exr", "-o", "out.exr", "--backend", "other"],
        ["process", "in.exr", "-o", "out.exr", "--threads", "many"],
    ],
)
def test_wrong_usage_is_2(potmesil: Runner, arguments: list[str]) -> None:
    ended = potmesil(*arguments)
    assert ended.status == 2
    assert ended.out == ""
    assert "usage:" in ended.err


def test_help_and_version_are_0(potmesil: Runner) -> None:
    assert potmesil("--version").out == f"Potmesil Camera {__version__}\n"
    for command in ((), ("dof",), ("psf",), ("info",), ("process",)):
        ended = potmesil(*command, "--help")
        assert ended.status == 0
        assert "usage:" in ended.out


@pytest.mark.parametrize("target", ["file/out.exr", "folder.exr", "file/out.png"])
def test_unwritable_output_is_4(potmesil: Runner, tmp_path: Path, target: str) -> None:
    source = plain_file(tmp_path)
    (tmp_path / "file").write_text("in the way")
    (tmp_path / "folder.exr").mkdir()
    before = sorted(tmp_path.rglob("*"))
    one_line(potmesil("process", source, "-o", tmp_path / target, *LENS, *SENSOR), 4)
    assert sorted(tmp_path.rglob("*")) == before


def test_unwritable_report_is_4(potmesil: Runner, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    options = [*LENS, *SENSOR, "--report", tmp_path / "file" / "report.json"]
    one_line(potmesil("process", plain_file(tmp_path), "-o", tmp_path / "out.exr", *options), 4)


def test_too_little_memory_is_33(potmesil: Runner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def exhausted(*_: object) -> NoReturn:
        raise MemoryError

    monkeypatch.setattr(exr, "read_samples", exhausted)
    ended = potmesil("process", plain_file(tmp_path), "-o", tmp_path / "out.exr", *LENS, *SENSOR)
    assert "memory" in one_line(ended, 33)


def test_ctrl_c_is_130(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> NoReturn:
        raise KeyboardInterrupt

    monkeypatch.setattr(exr, "read_samples", interrupted)
    assert (
        cli.main(["process", str(plain_file(tmp_path)), "-o", str(tmp_path / "out.exr"), *LENS, *SENSOR])
        == 130
    )


STRANGE = ["nan", "inf", "-inf", "0", "-0.0", "-1", "1e-30", "1e30", "1e-300", "1e300", "1e308", "5e-324"]


@pytest.mark.parametrize(
    "option", ["--focal-length", "--fstop", "--focus-distance", "--criterion", "--circle-mm"]
)
def test_dof_answers_any_number(potmesil: Runner, option: str) -> None:
    for value in STRANGE:
        for model in ("cycles", "paper"):
            ended = potmesil("dof", *LENS, "--coc-model", model, f"{option}={value}", "--json")
            if ended.status:
                one_line(ended, 2)
            else:
                assert ended.err == ""
                assert sorted(ended.json) == ["depth_of_field_m", "far_m", "hyperfocal_m", "near_m"]


@pytest.mark.parametrize(
    "option", ["--focal-length", "--fstop", "--focus-distance", "--depth", "--wavelength-nm"]
)
def test_psf_answers_any_number(potmesil: Runner, option: str) -> None:
    for value in STRANGE:
        for model in ("cycles", "paper"):
            ended = potmesil("psf", *LENS, "--depth", 4, "--coc-model", model, f"{option}={value}", "--json")
            if ended.status:
                one_line(ended, 2)
            else:
                assert ended.err == ""
                assert math.isfinite(ended.json["u"])


# In a process of its own


def test_module_runs_by_itself(tmp_path: Path) -> None:
    source = rendered_file(tmp_path)
    ended = own_process("process", source.name, "-o", "sub/out.exr", cwd=tmp_path)
    assert (ended.status, ended.err) == (0, "")
    lines = ended.out.splitlines()
    assert lines[0] == "openjd_status: processing (1 of 1)"
    assert f"Saved: '{tmp_path / 'sub' / 'out.exr'}'" in lines
    assert lines[-1] == "openjd_progress: 100.0"
    expected = run(process(exr.read_samples(source), ProcessSettings())).picture
    assert np.array_equal(read_rgba(tmp_path / "sub" / "out.exr"), expected)


def test_module_returns_the_status_of_the_shell(tmp_path: Path) -> None:
    assert own_process("--version").out == f"Potmesil Camera {__version__}\n"
    assert own_process("dof").status == 2
    values = own_process("dof", *LENS, "--json").json
    assert values["hyperfocal_m"] == pytest.approx(50.0 / 2.8)
    data = rendered_file(tmp_path).read_bytes()
    (tmp_path / "in.exr").write_bytes(data[:-200])
    one_line(own_process("process", "in.exr", "-o", "out.exr", cwd=tmp_path), 3)
    one_line(own_process("info", tmp_path / "none.exr"), 3)


def test_primaries_are_those_of_rec_709() -> None:
    red, green, blue = PRIMARY_WAVELENGTHS
    assert 600e-9 < red < 620e-9
    assert 540e-9 < green < 560e-9
    assert 455e-9 < blue < 475e-9


def shutter_of(*words: str) -> ShutterAttributes:
    parser = cli.build_parser("potmesil")
    return cli.process_settings(parser.parse_args(["process", "in.exr", "-o", "out.exr", *words])).shutter


def test_a_shutter_angle_is_a_share_of_a_frame() -> None:
    assert shutter_of("--shutter-angle", "172.8").frames == pytest.approx(0.48)
    gated = shutter_of("--shutter-angle", "180", "--shutter-gate", "36")
    assert gated.frames == pytest.approx(0.6)
    assert gated.slit is not None
    assert (gated.slit.edge, gated.slit.width) == ("top", pytest.approx(0.5 / 0.6))
    from_left = shutter_of("--shutter", "0.5", "--shutter-gate", "left:36").slit
    assert from_left is not None
    assert from_left.edge == "left"


def test_a_flash_is_said_by_its_curtain() -> None:
    assert shutter_of("--flash", "first").flash == Flash("first")
    assert shutter_of("--flash", "second:0.25:0.02:3").flash == Flash("second", 0.25, 0.02, 3)
    assert shutter_of("--flash", "none").flash == Flash(share=0.0)
    assert shutter_of().flash is None


@pytest.mark.parametrize(
    "words",
    [
        ("--flash", "third"),
        ("--flash", "first:x"),
        ("--flash", "first:0.5:0.1:1:1"),
        ("--flash", "first:2"),
        ("--flash", "first", "--slit", "top:0.1"),
        ("--shutter-gate", "10"),
        ("--shutter-gate", "-1", "--shutter", "0.5"),
        ("--shutter-gate", "middle:10", "--shutter", "0.5"),
        ("--shutter-gate", "10", "--shutter", "0.5", "--slit", "top:0.1"),
    ],
)
def test_shutters_that_cannot_be_are_refused(words: tuple[str, ...]) -> None:
    with pytest.raises(SettingsError):
        shutter_of(*words)
