"""The cube and the sphere: the scene, its small file, and figures 11 to 14 of TOG 1982 made from it."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from figures import depth_of_field as figure
from figures.workshop import Workshop

bpy = pytest.importorskip("bpy", reason="the bpy module is not installed")

MEGABYTE = 1_000_000


@pytest.fixture(scope="module")
def workshop(extension, tmp_path_factory):
    return Workshop(tmp_path_factory.mktemp("figures"), percentage=16)


@pytest.fixture(scope="module")
def samples(workshop):
    return figure.rendered_corners(workshop)


@pytest.fixture(scope="module")
def drawing(workshop, samples):
    return figure.draw_pictures(workshop)


def test_the_file_is_small_and_holds_its_picture(extension, tmp_path):
    from sample_scenes import catalogue

    path = tmp_path / "cube.blend"
    catalogue.save("cube_and_sphere", path)
    assert path.stat().st_size < 1.2 * MEGABYTE
    bpy.ops.wm.open_mainfile(filepath=str(path))
    picture = bpy.data.images["Plumage"]
    assert picture.packed_file is not None
    assert tuple(picture.size) == (512, 512)


def test_moving_it_starts_from_rest(extension):
    from sample_scenes import cube_and_sphere

    scene = cube_and_sphere.build(moving=True)
    places = {}
    for frame in (1, 2):
        scene.frame_set(frame)
        sphere, cube = bpy.data.objects["Sphere"], bpy.data.objects["Cube"]
        places[frame] = np.array([*sphere.matrix_world.translation, cube.rotation_euler.z])
    cube_and_sphere.build()
    bpy.context.view_layer.update()
    sphere, cube = bpy.data.objects["Sphere"], bpy.data.objects["Cube"]
    assert places[1] == pytest.approx([*sphere.matrix_world.translation, cube.rotation_euler.z], abs=1e-6)
    assert places[2] - places[1] == pytest.approx([0.030, 0.0, 0.006, np.radians(24.0)], abs=1e-6)


def test_corner_samples_lie_where_the_papers_scene_stands(workshop, samples):
    side = 2 * figure.picture_side(workshop)
    assert samples.layers[0].depth.shape == (side + 1, side + 1)
    assert (samples.position, samples.supersampling) == ("corner", 2)
    assert samples.film.width == pytest.approx(0.030)
    assert samples.camera.axis_x == pytest.approx(0.5 * side)
    depth, index = samples.layers[0].depth, samples.layers[0].object_index
    cube, sphere, background = (depth[index == number] for number in (1, 2, 3))
    # Approximately 290, 550 and 980 mm, the sphere mostly within what is sharp at f/5.6 (Table 1).
    assert 0.281 < sphere.min() < np.median(sphere) < 0.299
    assert np.median(cube) == pytest.approx(0.550, abs=0.02)
    assert background.max() == pytest.approx(0.980, abs=0.01)
    # Point samples: no sample is a mixture of two depths.
    assert set(np.unique(index)) == {1, 2, 3}
    assert not np.any((depth > cube.max() + 0.01) & (depth < 0.85))


def test_thirteen_pictures_are_written_at_the_workshops_size(workshop, drawing):
    assert drawing.path.is_file()
    for name in ("11", *(row.figure for row in figure.TABLE_1)):
        with Image.open(workshop.path(f"tog_{name}")) as picture:
            assert picture.size == (figure.picture_side(workshop),) * 2


def test_circles_are_those_of_a_picture_of_this_size(workshop, drawing):
    # TOG 1982, eq. 9 worked out, at the sphere's front in pixels of 30 mm / side.
    for row in figure.TABLE_1:
        found, focus = drawing.numbers[row.figure], row.focus / 1000.0
        near = found["nearest_m"]
        circle = 0.055**2 / row.f_stop * (near - focus) / (near * (focus - 0.055))
        pixels = circle / (0.030 / figure.picture_side(workshop))
        assert found["nearest_circle_px"] == pytest.approx(pixels, rel=1e-5)
        # Tables at 1 mm, where there is something.
        assert 100 < found["tables"] < 711


def test_each_column_has_its_object_sharp_and_each_row_less_blur(drawing):
    sharp = {name: numbers["sharpness"] for name, numbers in drawing.numbers.items()}
    for figure_number in ("12", "13", "14"):
        for column, item in (("b", "background"), ("c", "cube"), ("d", "sphere")):
            focused = sharp[figure_number + column][item]
            assert focused > 0.97
            others = [sharp[figure_number + other][item] for other in "abcd" if other != column]
            # Circles smaller than a pixel, as most are at this size in figure 14, change nothing to speak of.
            assert focused > max(others) - 0.01
    for item in figure.OBJECTS:
        # Focused behind everything, at smaller and smaller apertures.
        assert sharp["12a"][item] < sharp["13a"][item] + 0.01 < sharp["14a"][item] + 0.02
    assert sharp["12d"]["cube"] < 0.7 * sharp["12c"]["cube"]
    assert sharp["12d"]["background"] < 0.7 * sharp["12b"]["background"]
    assert sharp["12c"]["sphere"] < 0.7 * sharp["12d"]["sphere"]
