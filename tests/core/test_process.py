"""From samples and settings to a picture: what overrides what, layers, supersampling, the report."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest

from potmesil_addon.camera import Film
from potmesil_addon.errors import InputError, SettingsError
from potmesil_addon.focus import FocusSettings
from potmesil_addon.lens import Lens
from potmesil_addon.process import ProcessSettings, focus_settings, process
from potmesil_addon.progress import run
from potmesil_addon.psf import PsfSettings
from potmesil_addon.samples import LensAttributes, SampleLayer, Samples, Window
from potmesil_addon.visibility import VISIBILITIES, Visibility

from .helpers import Picture, focused, importable, make_samples, write_exr

STORED = LensAttributes(0.05, 2.8, 3.0, 5, 0.1, 1.5)
FILM = Film(1.2e-3, 0.8e-3, 12, 8)


def stored_samples(seed: int = 1, **others: Any) -> Samples:
    rng = np.random.default_rng(seed)
    color = rng.random((8, 12, 4))
    color[..., 3] = 1.0
    return make_samples(color, rng.uniform(1.0, 9.0, (8, 12)), **{"lens": STORED, "film": FILM, **others})


def picture_of(samples: Samples, settings: ProcessSettings | None = None) -> Picture:
    return run(process(samples, settings or ProcessSettings())).picture


# Settings


def test_the_file_gives_what_the_settings_leave_open() -> None:
    found = focus_settings(stored_samples(), ProcessSettings())
    assert found.lens == Lens(0.05, 2.8, 3.0, 5, 0.1, 1.5)
    assert found.film == FILM


@pytest.mark.parametrize(
    ("wanted", "expected"),
    [
        ({"focal_length": 0.085}, {"focal_length": 0.085}),
        ({"f_stop": 1.4}, {"f_stop": 1.4}),
        ({"focus_distance": math.inf}, {"focus_distance": math.inf}),
        ({"blades": 0}, {"blades": 0}),
        ({"blade_rotation": 0.0}, {"blade_rotation": 0.0}),
        ({"anamorphic_ratio": 1.0}, {"anamorphic_ratio": 1.0}),
    ],
)
def test_settings_win_over_the_file(wanted: dict[str, Any], expected: dict[str, Any]) -> None:
    found = focus_settings(stored_samples(), ProcessSettings(lens=LensAttributes(**wanted)))
    assert found.lens == replace(Lens(0.05, 2.8, 3.0, 5, 0.1, 1.5), **expected)


def test_a_sensor_in_the_settings_wins_over_the_files_film() -> None:
    found = focus_settings(stored_samples(), ProcessSettings(sensor_width=0.036))
    assert (found.film.width, found.film.height) == pytest.approx((0.036, 0.024), rel=1e-12)
    assert (found.film.columns, found.film.rows) == (12, 8)


def test_the_films_pixels_have_the_files_aspect() -> None:
    found = focus_settings(stored_samples(pixel_aspect=2.0), ProcessSettings(sensor_width=0.036))
    assert found.film.height == pytest.approx(0.012, rel=1e-12)


@pytest.mark.parametrize(
    ("missing", "option"),
    [
        ("focal_length", "--focal-length"),
        ("f_stop", "--fstop"),
        ("focus_distance", "--focus-distance"),
    ],
)
def test_what_nobody_says_is_asked_for_by_its_option(missing: str, option: str) -> None:
    samples = stored_samples(lens=replace(STORED, **{missing: None}))
    with pytest.raises(SettingsError, match=option):
        focus_settings(samples, ProcessSettings())


def test_a_missing_sensor_is_asked_for_by_its_option() -> None:
    with pytest.raises(SettingsError, match="--sensor-width"):
        focus_settings(stored_samples(film=None), ProcessSettings())


def test_a_files_own_nonsense_is_refused() -> None:
    with pytest.raises(SettingsError, match="Blades"):
        focus_settings(stored_samples(lens=replace(STORED, blades=-2)), ProcessSettings())


def test_round_lens_by_default() -> None:
    samples = stored_samples(lens=LensAttributes(0.05, 2.8, 3.0))
    assert focus_settings(samples, ProcessSettings()).lens == Lens(0.05, 2.8, 3.0)


# Pictures


@pytest.mark.parametrize("visibility", VISIBILITIES)
def test_process_focuses(visibility: Visibility) -> None:
    samples = stored_samples()
    settings = FocusSettings(Lens(0.05, 2.8, 3.0, 5, 0.1, 1.5), FILM, visibility=visibility)
    picture = picture_of(samples, ProcessSettings(visibility=visibility))
    assert np.array_equal(picture, focused(samples, settings))


def test_near_surfaces_hide_far_ones_unless_told_otherwise() -> None:
    samples = stored_samples()
    pictures = {v: picture_of(samples, ProcessSettings(visibility=v)) for v in VISIBILITIES}
    assert np.array_equal(picture_of(samples), pictures["aperture"])
    assert np.abs(pictures["aperture"] - pictures["none"]).max() > 0.01


def test_without_the_lens_samples_are_pixels() -> None:
    samples = stored_samples(display=Window(-1, 2, 9, 12))
    picture = picture_of(samples, ProcessSettings(use_lens=False))
    assert picture.shape == (10, 10, 4)
    assert np.array_equal(picture[:6, 1:], samples.layers[0].color[2:, :9])
    assert not picture[6:].any()
    assert not picture[:, 0].any()


def test_without_the_lens_a_file_needs_no_lens_and_no_depth() -> None:
    layer = SampleLayer("", np.ones((3, 4, 4), dtype=np.float32))
    samples = Samples((layer,), Window(0, 0, 4, 3), Window(0, 0, 4, 3))
    result = run(process(samples, ProcessSettings(use_lens=False)))
    assert (result.picture == 1.0).all()
    assert result.report["lens"] is None
    with pytest.raises(InputError, match="no depth"):
        run(process(replace(samples, lens=STORED, film=Film(1.0, 1.0, 4, 3)), ProcessSettings()))


def test_without_the_lens_a_pixel_is_the_mean_of_its_corners() -> None:
    color = np.arange(3 * 4 * 4, dtype=np.float32).reshape(3, 4, 4)
    samples = make_samples(color, 2.0, position="corner", display=Window(0, 0, 3, 2))
    picture = picture_of(samples, ProcessSettings(use_lens=False))
    assert picture.shape == (2, 3, 4)
    for row, column in np.ndindex(2, 3):
        square = color[row : row + 2, column : column + 2]
        assert picture[row, column].tolist() == square.mean(axis=(0, 1)).tolist()


def layered(*layers: tuple[str, Any, float]) -> Samples:
    """Return samples of flat layers, each a color over all the frame at one depth."""
    made = tuple(
        SampleLayer(
            name,
            np.broadcast_to(np.asarray(color, dtype=np.float32), (4, 5, 4)).copy(),
            np.full((4, 5), depth, dtype=np.float32),
        )
        for name, color, depth in layers
    )
    window = Window(0, 0, 5, 4)
    return Samples(made, window, window, lens=STORED, film=Film(1e-3, 0.8e-3, 5, 4))


RED = [0.25, 0.0, 0.0, 0.5]
GREEN = [0.0, 1.0, 0.0, 1.0]
BLUE = [0.0, 0.0, 0.25, 0.25]


@pytest.mark.parametrize("use_lens", [True, False])
@pytest.mark.parametrize(
    "order", [(("a", RED, 2.0), ("b", GREEN, 8.0)), (("b", GREEN, 8.0), ("a", RED, 2.0))], ids=["near", "far"]
)
def test_the_nearer_layer_lies_in_front_wherever_it_stands_in_the_file(order: Any, use_lens: bool) -> None:
    picture = picture_of(layered(*order), ProcessSettings(use_lens=use_lens))
    np.testing.assert_allclose(picture, np.broadcast_to([0.25, 0.5, 0.0, 1.0], (4, 5, 4)), atol=1e-6)


def test_three_layers_by_hand() -> None:
    result = run(
        process(layered(("far", GREEN, 8.0), ("near", BLUE, 1.0), ("middle", RED, 2.0)), ProcessSettings())
    )
    # Blue over red over green: 3/4 of red (1/4) is 3/16, 3/4 of half of green is 3/8.
    np.testing.assert_allclose(result.picture[1, 2], [3 / 16, 3 / 8, 1 / 4, 1.0], atol=1e-6)
    assert result.report["layers"] == ["near", "middle", "far"]
    assert [entry["layer"] for entry in result.report["focus"]] == ["near", "middle", "far"]


def test_what_a_layer_does_not_show_does_not_order_it() -> None:
    """A foreground's empty pixels are at infinity; its place is that of what it shows."""
    samples = layered(("back", GREEN, 8.0), ("front", RED, 2.0))
    front = samples.layers[1]
    assert front.depth is not None
    front.color[:3] = 0.0
    front.depth[:3] = np.inf
    picture = picture_of(samples, ProcessSettings(use_lens=False))
    np.testing.assert_allclose(picture[3, 0], [0.25, 0.5, 0.0, 1.0], atol=1e-6)
    np.testing.assert_allclose(picture[0, 0], GREEN, atol=1e-6)


def test_a_layer_without_a_surface_lies_behind() -> None:
    picture = picture_of(layered(("sky", GREEN, math.inf), ("front", RED, 2.0)))
    np.testing.assert_allclose(picture[1, 1], [0.25, 0.5, 0.0, 1.0], atol=1e-6)


@pytest.mark.parametrize("use_lens", [True, False])
def test_supersampled_input_is_averaged_down(use_lens: bool) -> None:
    """Without visibility, which takes edges of an ordinary render apart and those of point samples not."""
    samples = stored_samples(supersampling=2)
    settings = ProcessSettings(use_lens=use_lens, visibility="none")
    result = run(process(samples, settings))
    single = picture_of(replace(samples, supersampling=1), settings)
    assert result.picture.shape == (4, 6, 4)
    for row, column in np.ndindex(4, 6):
        square = single[2 * row : 2 * row + 2, 2 * column : 2 * column + 2]
        np.testing.assert_allclose(result.picture[row, column], square.mean(axis=(0, 1)), atol=1e-6)
    assert result.report["size"] == [6, 4]
    assert result.display_window == Window(0, 0, 6, 4)


def test_supersampling_keeps_the_circles_size_on_the_film() -> None:
    """Twice the samples each way over the same film: a circle covers twice the pixels, then half again."""
    color = np.zeros((80, 80, 4))
    color[..., 3] = 1.0
    color[40:42, 40:42] = 1.0
    film = Film(8e-3, 8e-3, 80, 80)
    # At infinity F^2 / (n D) = 2.5 mm: 25 of the fine pixels, a radius of 6.25 of the coarse ones.
    lens = LensAttributes(0.05, 1.0, 1.0)
    fine = make_samples(color, math.inf, lens=lens, film=film, supersampling=2)
    coarse = make_samples(color[::2, ::2], math.inf, lens=lens, film=replace(film, columns=40, rows=40))
    # A disc has r^2/4 along an axis, pixels add 1/12, and the fine light is four samples 1/4 off its middle.
    for samples, more in ((coarse, 0.0), (fine, 1.0 / 16.0)):
        light = picture_of(samples, ProcessSettings(visibility="none"))[..., 0].astype(np.float64)
        at = np.arange(40)
        mean = (light.sum(axis=0) * at).sum() / light.sum()
        spread = (light.sum(axis=0) * (at - mean) ** 2).sum() / light.sum()
        assert light.sum() == pytest.approx(1.0, abs=1e-4)
        assert mean == pytest.approx(20.0, abs=1e-4)
        assert spread == pytest.approx(6.25**2 / 4.0 + 1.0 / 12.0 + more, rel=5e-3)


def test_progress_rises_to_1_over_all_layers() -> None:
    shares = list(process(layered(("a", RED, 2.0), ("b", GREEN, 8.0), ("c", BLUE, 9.0)), ProcessSettings()))
    assert shares == sorted(shares)
    assert 0.0 < shares[0] < 0.1
    assert shares[-1] == 1.0
    assert sum(share > 0.4 for share in shares) > 1


def test_report_is_json_and_says_what_was_done() -> None:
    samples = stored_samples(repaired={"color": 3})
    psf = PsfSettings(tables="equal-z", lookup="interpolated", step=0.5)
    settings = ProcessSettings(psf=psf, model="paper", weighting="1981", lens=LensAttributes(blades=0))
    report = json.loads(json.dumps(run(process(samples, settings)).report, allow_nan=False))
    assert report["size"] == [12, 8]
    assert report["repaired"] == {"color": 3}
    assert report["seconds"] > 0.0
    lens = report["lens"]
    assert lens["focal_length_mm"] == pytest.approx(50.0)
    assert (lens["f_stop"], lens["focus_distance_m"], lens["blades"]) == (2.8, 3.0, 0)
    assert lens["blade_rotation_deg"] == pytest.approx(math.degrees(0.1))
    assert (lens["coc_model"], lens["psf"], lens["weighting"]) == ("paper", "disc", "1981")
    assert (lens["tables"], lens["lookup"]) == ("equal-z", "interpolated")
    assert lens["film_mm"] == pytest.approx([1.2, 0.8])


def test_process_leaves_its_samples_alone() -> None:
    samples = stored_samples()
    layer = samples.layers[0]
    assert layer.depth is not None
    before = layer.color.copy(), layer.depth.copy()
    picture_of(samples)
    assert np.array_equal(layer.color, before[0])
    assert np.array_equal(layer.depth, before[1])


def test_without_numba_the_picture_is_the_same(tmp_path: Path) -> None:
    """In a process of its own, where numba cannot be imported."""
    samples = stored_samples()
    layer = samples.layers[0]
    assert layer.depth is not None
    channels = {name: np.ascontiguousarray(layer.color[..., i]) for i, name in enumerate("RGBA")}
    write_exr(tmp_path / "in.exr", {**channels, "Z": layer.depth})
    code = (
        "import sys; sys.modules['numba'] = None\n"
        "from potmesil_addon import cli, jit\n"
        "assert not jit.HAVE_NUMBA\n"
        "sys.exit(cli.main(sys.argv[1:]))\n"
    )
    options = ["--focal-length", "50", "--fstop", "2.8", "--focus-distance", "3", "--sensor-width", "1.2"]
    arguments = ["process", "in.exr", "-o", "out.exr", *options, "--psf", "lommel", "--threads", "4"]
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=tmp_path,
        env=importable(),
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    written = OpenEXR.File(str(tmp_path / "out.exr")).channels()["RGBA"].pixels
    lens = LensAttributes(0.05, 2.8, 3.0, blades=0, anamorphic_ratio=1.0)
    settings = ProcessSettings(lens=lens, psf=PsfSettings(kind="lommel"))
    assert np.abs(written - picture_of(samples, settings)).max() < 1e-6
