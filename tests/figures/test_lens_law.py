"""The diagrams of TOG 1982, figures 2 to 5: what is drawn obeys geometry, not only our formulas."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from figures import lens_law
from figures.workshop import Figure, Workshop

Place = npt.NDArray[np.float64]

LIMITS = {
    # TOG 1982, Table 1: f-stop and focused distance, then the far and the near limit, all printed in mm.
    (5.6, 2000): (2511, 1662),
    (5.6, 290): (299, 282),
    (11, 980): (1219, 819),
    (22, 2000): (10000, 1111),
    (22, 550): (705, 451),
}


def height_at(begin: Place, end: Place, along: float) -> float:
    """Return the height of the line through two places."""
    share = (along - begin[0]) / (end[0] - begin[0])
    return float(begin[1] + share * (end[1] - begin[1]))


@pytest.mark.parametrize("distance", [0.07, 0.29, 2.0])
def test_construction_rays_pass_the_focal_points_and_meet_at_the_image(distance):
    lens = lens_law.papers_lens(focus_distance=distance)
    rays = lens_law.ray_diagram(lens, 0.02)
    parallel, central, front = rays.rays
    f = lens.focal_length
    assert parallel[0, 1] == parallel[1, 1]
    assert height_at(parallel[1], parallel[2], f) == pytest.approx(0.0, abs=1e-12)
    assert height_at(central[0], central[2], 0.0) == pytest.approx(0.0, abs=1e-12)
    assert height_at(front[0], front[1], -f) == pytest.approx(0.0, abs=1e-12)
    assert front[1, 1] == pytest.approx(front[2, 1], rel=1e-12)
    # Every ray that a thin lens bends through one point is turned by height / F: also those of the rim.
    for begin, at, end in (*rays.rays, *rays.cone):
        before, after = (at - begin)[1] / (at - begin)[0], (end - at)[1] / (end - at)[0]
        assert before - after == pytest.approx(at[1] / f, rel=1e-12, abs=1e-15)
        assert (end == rays.image).all()
    assert rays.cone[0, 1, 1] - rays.cone[1, 1, 1] == pytest.approx(f / 5.6)


@pytest.mark.parametrize(("camera", "printed"), LIMITS.items())
def test_sharp_triangles_are_similar_and_end_at_the_printed_limits(camera, printed):
    lens = lens_law.papers_lens(camera[0], camera[1] / 1000.0)
    t = lens_law.sharp_triangles(lens)
    assert t.m[1] - t.n[1] == pytest.approx(lens.focus_distance / 1000.0)
    assert t.left[1] - t.right[1] == pytest.approx(0.055 / camera[0])
    # The patch is cut from the far cone; the near one has crossed on the axis and is as wide there.
    assert height_at(t.left, t.a, t.m[0]) == pytest.approx(t.m[1], rel=1e-9)
    assert height_at(t.left, t.b, t.n[0]) == pytest.approx(t.n[1], rel=1e-9)
    assert (round(t.a[0] * 1000), round(t.b[0] * 1000)) == printed


@pytest.mark.parametrize("depth", [0.1, 0.29, 0.54, 0.56, 0.98, 50.0])
@pytest.mark.parametrize("f_stop", lens_law.F_STOPS)
def test_the_circle_of_confusion_is_where_the_rays_meet_the_film(depth, f_stop):
    t = lens_law.confusion_triangles(lens_law.papers_lens(f_stop, 0.55), depth)
    film = t.e[0]
    assert 1.0 / film + 1.0 / 0.55 == pytest.approx(1.0 / 0.055)
    assert height_at(t.left, t.a, film) == pytest.approx(t.e[1], rel=1e-9)
    assert height_at(t.right, t.a, film) == pytest.approx(t.b[1], rel=1e-9)
    # Nearer points converge behind the film, before the rays have crossed.
    assert (t.e[1] > t.b[1]) == (depth < 0.55)


@pytest.mark.parametrize("focus", lens_law.FOCUS_DISTANCES)
def test_circles_are_as_asymmetric_as_the_lens_law_has_them(focus):
    lens = lens_law.papers_lens(focus_distance=focus)
    depth = np.array([focus / 2.0, focus, 2.0 * focus, 1e9])
    for model in ("paper", "cycles"):
        curve = lens_law.confusion_curve(lens, model, depth)
        near, sharp, twice, far = curve.circle
        assert sharp == pytest.approx(0.0, abs=1e-15)
        # At half the distance as large as at infinity; at twice the distance half as large.
        assert -near == pytest.approx(far, rel=1e-6)
        assert twice == pytest.approx(far / 2.0, rel=1e-6)
        assert curve.at_infinity == pytest.approx(far, rel=1e-6)
        # A thousandth of the distance between lens and film, on both sides.
        film = 1.0 / (1.0 / 0.055 - 1.0 / focus) if model == "paper" else 0.055
        assert curve.limit_circles == pytest.approx([-film / 1000.0, film / 1000.0], rel=1e-9)


@pytest.mark.parametrize("figure", lens_law.FIGURES, ids=lambda figure: figure.name)
def test_figures_are_drawn(tmp_path: Path, figure: Figure):
    drawing = figure.draw(Workshop(tmp_path, percentage=25))
    with Image.open(drawing.path) as image:
        assert drawing.path.name == f"{figure.name}.png"
        assert 150 < image.width < 500
        assert 80 < image.height < 400
