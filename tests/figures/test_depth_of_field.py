"""Table 1 as it is printed, and as it is measured in pictures of a receding edge."""

from __future__ import annotations

import math

import numpy as np
import pytest

from figures import depth_of_field as figure
from figures.workshop import Workshop, processed
from potmesil_addon.camera import Camera, Film
from potmesil_addon.lens import depth_of_field, image_distance
from potmesil_addon.process import ProcessSettings
from potmesil_addon.samples import SampleLayer, Samples, Window
from tests.core.helpers import diffraction_integral

ROWS = pytest.mark.parametrize("row", figure.TABLE_1, ids=lambda row: row.figure)


def test_table_1_is_the_printed_one(tmp_path):
    drawing = figure.draw_table(Workshop(tmp_path))
    assert len(drawing.numbers) == 12
    for row in figure.TABLE_1:
        assert drawing.numbers[row.figure] == {"far": row.far, "near": row.near, "total": row.total}
    assert "| 14a | 22 | 2000 | 10000 | 10000 |" in drawing.table
    assert drawing.path.is_file()


@ROWS
@pytest.mark.parametrize("model", ["paper", "cycles"])
def test_pictures_turn_blurred_at_the_printed_limits(row, model):
    # Tables 1 mm apart leave half a millimetre open. Pixels of 1/24 patch add 0.12 % to a blur of one patch,
    # rows that change by a tenth of it within its height about as much; the blur is 1/P - 1/D over 1/H.
    exact, found = depth_of_field(row.lens), figure.measured(row, model=model)
    for seen, limit, printed in ((found.near, exact.near, row.near), (found.far, exact.far, row.far)):
        open_ = 0.0005 + 0.004 / exact.hyperfocal * seen * limit
        assert abs(seen - limit) < open_
        assert abs(seen - printed / 1000.0) < open_ + 0.0005


def test_nothing_is_too_far_beyond_the_hyperfocal_distance():
    row = figure.Printed("", 22, 3000, 0, 0, 0)
    assert row.lens.focus_distance > depth_of_field(row.lens).hyperfocal
    found = figure.measured(row)
    assert math.isinf(found.far)
    assert found.near == pytest.approx(depth_of_field(row.lens).near, rel=0.004)


def test_an_edge_spread_by_a_disc_has_the_width_of_the_disc():
    # The share of a disc of radius 1 on the left of x, by the area of its segment.
    diameter, pitch = 61e-6, 2.5e-6
    edges = np.clip((np.arange(73) - 36) * pitch / (0.5 * diameter), -1.0, 1.0)
    share = 0.5 + (np.arcsin(edges) + edges * np.sqrt(1.0 - edges**2)) / np.pi
    picture = np.repeat(share[np.newaxis, :, np.newaxis], 4, axis=2).astype(np.float32)
    assert figure.edge_blur(picture, pitch) == pytest.approx([diameter], rel=0.002)


def test_the_papers_diffraction_narrows_the_blur_as_its_integral_says():
    row = figure.TABLE_1[10]
    lens, found = row.lens, figure.measured(row, "lommel")
    middle = int(np.argmin(np.abs(found.depth - row.near / 1000.0)))
    point = found.depth[middle]
    # TOG 1982, eqs. 8, 9, 17 and 18; green light.
    film, sharp = (image_distance(d, lens.focal_length) for d in (lens.focus_distance, point))
    radius = 0.5 * lens.aperture_diameter * abs(film - sharp) / sharp
    wave_number = 2.0 * math.pi / 549e-9
    u = wave_number * (0.5 / lens.f_stop) ** 2 * (sharp - film)
    r = (np.arange(2000) + 0.5) / 2000.0 * radius
    light = diffraction_integral(float(u), wave_number * 0.5 / lens.f_stop * r) * r
    # The variance along one axis is half of the mean square of the radius.
    expected = 4.0 * math.sqrt(0.5 * (light @ r**2) / light.sum())
    assert expected < 0.9 * 2.0 * radius
    assert found.blur[middle] == pytest.approx(expected, rel=0.01)
    # With the light that diffraction throws past the rim it is wider than the disc instead.
    whole = figure.measured(row, "lommel", "cycles")
    assert whole.near > 1.02 * row.near / 1000.0
    assert whole.far < 0.98 * row.far / 1000.0


def samples_of(color, pitch=1e-4):
    rows, columns = color.shape
    window, film = Window(0, 0, columns, rows), Film(columns * pitch, rows * pitch, columns, rows)
    values = np.repeat(color[..., np.newaxis], 4, axis=2).astype(np.float32)
    camera = Camera(np.eye(4), 0.055, film, 0.5 * columns, 0.5 * rows)
    return Samples((SampleLayer("", values),), window, window, film=film, camera=camera)


def test_pixel_centres_become_the_corners_between_them():
    down, right = np.mgrid[0:9, 0:9]
    before = samples_of(right + 10.0 * down)
    after = figure.corner_samples(before)
    assert (after.display_window.columns, after.data_window.columns) == (8, 9)
    assert after.film.pitch_x == pytest.approx(before.film.pitch_x)
    assert after.film.width == pytest.approx(before.film.width * 8 / 9)
    point = [0.003, -0.002, -0.5]
    assert after.camera.project(point)[0] == pytest.approx(before.camera.project(point)[0] - 0.5)
    # A final pixel is the mean around the corner in its middle.
    picture = processed(after, ProcessSettings(use_lens=False, use_motion=False)).picture
    assert picture[..., 0] == pytest.approx((right + 10.0 * down)[1::2, 1::2])


def test_the_plot_comes_with_its_numbers(tmp_path, monkeypatch):
    discs = {row: figure.measured(row) for row in figure.TABLE_1}
    # Diffraction patterns take longer, and are measured above.
    monkeypatch.setattr(figure, "measured", lambda row, *_: discs[row])
    drawing = figure.draw_measured(Workshop(tmp_path, percentage=10))
    assert drawing.path.is_file()
    assert len(drawing.table.splitlines()) == 2 + 12
    for row in figure.TABLE_1:
        found = drawing.numbers[row.figure]
        assert abs(found["near_error_percent"]) < 0.2
        assert found["near_mm"] - found["near_error_mm"] == pytest.approx(row.near, abs=0.5)
        assert found["far_mm"] - found["far_error_mm"] == pytest.approx(row.far, abs=0.5)
