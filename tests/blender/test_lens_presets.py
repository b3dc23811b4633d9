"""Presets of real lenses: each sets what its page documents, and the published figures follow from it."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
optimize = pytest.importorskip("scipy.optimize")

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "presets" / "potmesil_lens"
PAGE = (ROOT / "docs" / "lenses.md").read_text(encoding="utf-8")
MENU = "POTMESIL_PT_lens_presets"

WIDTH, HEIGHT = 36.0, 24.0
CORNER = 0.5 * math.hypot(WIDTH, HEIGHT)

PLAIN = {
    "camera.sensor_fit": "HORIZONTAL",
    "camera.sensor_width": WIDTH,
    "camera.sensor_height": HEIGHT,
    "camera.dof.aperture_blades": 0,
    "camera.dof.aperture_rotation": 0.0,
    "camera.dof.aperture_ratio": 1.0,
}
"""What every preset sets of the camera where the page says nothing."""


def said(path: Path) -> dict[str, Any]:
    """Return the settings of a preset, an effect's without ``effects.``."""
    pairs = (line.partition(" = ") for line in path.read_text().splitlines())
    values = {name: eval(value, {}) for name, _, value in pairs if "." in name}
    return {name.removeprefix("effects."): value for name, value in values.items()}


REAL = {path.stem.replace("_slash_", "/").replace("_", " "): path for path in FOLDER.glob("*.py")}
REAL = {name: path for name, path in REAL.items() if "camera.lens" in said(path)}

NEUTRAL = said(FOLDER / "Neutral.py")


def documented() -> dict[str, dict[str, float]]:
    """Return the values of the page by lens and setting."""
    tables = {}
    for section in PAGE.split("\n### ")[1:]:
        heading, _, text = section.partition("\n")
        rows = re.findall(r"^\| `([\w.]+)` \| (\S+) \|", text, re.MULTILINE)
        tables[heading] = {setting: float(value) for setting, value in rows}
    return tables


DOCUMENTED = documented()

Falls = dict[str, list[tuple[float, float, float]]]


def documented_falls() -> Falls:
    """Return f-stop, published fall and the preset's fall in the corner, by lens."""
    found: Falls = {}
    for lens, *numbers in re.findall(r"^\| (\w[^|]*) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|", PAGE, re.M):
        f_stop, published, preset = map(float, numbers)
        found.setdefault(lens, []).append((f_stop, published, preset))
    return found


FALLS = documented_falls()

DISTORTED = {"Leica Summilux-M 28 mm f/1.4": 0.011, "Nikon Zoom-Nikkor 35-105 mm at 35 mm f/3.5": -0.046}
"""What is published of the height of the image in the corner."""

NATURAL = {"Leica Elmar-M 24 mm f/3.8": 1.4, "Leica Summilux-M 21 mm f/1.4": 1.7}
"""Stops that are published as natural vignetting's."""


def test_page_and_presets_have_the_same_lenses() -> None:
    assert set(DOCUMENTED) == set(REAL)
    assert len(REAL) == 12


@pytest.mark.parametrize("name", REAL)
def test_menu_shows_the_name_of_the_page(name: str) -> None:
    assert bpy.path.display_name(REAL[name].name, title_case=False) == name


@pytest.mark.parametrize("name", REAL)
def test_preset_sets_what_the_page_says_and_nothing_else(name: str) -> None:
    values = said(REAL[name])
    told = DOCUMENTED[name]
    effects_on = {setting.partition(".")[0] for setting in told} - {"camera"}
    expected = {**PLAIN, **NEUTRAL, **told, **{f"{effect}.use": True for effect in effects_on}}
    assert values == expected


@pytest.mark.parametrize("name", REAL)
def test_preset_runs(name: str, scene: Any) -> None:
    assert bpy.ops.script.execute_preset(filepath=str(REAL[name]), menu_idname=MENU) == {"FINISHED"}
    effects = scene.potmesil_camera.effects
    for setting, wanted in said(REAL[name]).items():
        owner, _, rest = setting.partition(".")
        holder: Any = scene.camera.data if owner == "camera" else getattr(effects, owner)
        *parents, last = rest.split(".")
        for parent in parents:
            holder = getattr(holder, parent)
        assert getattr(holder, last) == (pytest.approx(wanted) if isinstance(wanted, float) else wanted)


def test_distortion_is_documented_where_the_presets_have_it() -> None:
    assert {name for name, path in REAL.items() if said(path)["distortion.use"]} == set(DISTORTED)


@pytest.mark.parametrize("name", DISTORTED)
def test_corner_is_off_by_the_published_share(name: str, module: Any) -> None:
    values = said(REAL[name])
    distortion = module("potmesil_addon.effects").Distortion(model="brown", k1=values["distortion.k1"])
    focal = values["camera.lens"]
    # Pixels of a millimetre, the axis in the middle.
    axis = np.array([0.5 * WIDTH, 0.5 * HEIGHT])
    lens_map = module("potmesil_addon.distortion").LensMap(
        distortion, focal, focal, *axis, columns=int(WIDTH), rows=int(HEIGHT)
    )
    ideal = float(np.hypot(*(lens_map.undistort([0.0, 0.0]) - axis)))
    assert (CORNER - ideal) / ideal == pytest.approx(DISTORTED[name], abs=2e-5)


@pytest.mark.parametrize("name", DISTORTED)
def test_corner_is_off_by_the_published_share_by_the_formula(name: str) -> None:
    values = said(REAL[name])
    focal, k1 = values["camera.lens"], values["distortion.k1"]
    ideal = optimize.brentq(lambda y: y * (1.0 + k1 * (y / focal) ** 2) - CORNER, 0.0, 1.2 * CORNER)
    assert CORNER / ideal - 1.0 == pytest.approx(DISTORTED[name], abs=2e-5)


def fall(module: Any, values: dict[str, Any], mechanical: float, f_stop: float) -> float:
    """Return by how many stops the corner is darker than the middle."""
    pupil, effects = module("potmesil_addon.pupil"), module("potmesil_addon.effects")
    focal, blades = values["camera.lens"], values["camera.dof.aperture_blades"]
    lens = module("potmesil_addon.lens").Lens(1e-3 * focal, f_stop, math.inf, blades)
    vignetting = effects.Vignetting(
        natural=values["vignetting.natural"],
        mechanical=mechanical,
        fastest_f_stop=values["vignetting.fastest_f_stop"],
    )
    barrel = pupil.barrel_at(lens, vignetting, 0.5 * WIDTH / CORNER, 0.5 * HEIGHT / CORNER)
    cosine_4 = math.cos(math.atan(CORNER / focal)) ** 4
    light = (1.0 - vignetting.natural * (1.0 - cosine_4)) * pupil.clear_share(lens, None, barrel)
    return -math.log2(light)


def test_vignetting_is_documented_where_the_presets_have_it() -> None:
    assert {name for name, path in REAL.items() if said(path)["vignetting.use"]} == set(FALLS)


@pytest.mark.parametrize("name", FALLS)
def test_corner_falls_as_the_page_says(name: str, module: Any) -> None:
    values = said(REAL[name])
    for f_stop, _, preset in FALLS[name]:
        assert fall(module, values, values["vignetting.mechanical"], f_stop) == pytest.approx(
            preset, abs=0.006
        )


@pytest.mark.parametrize("name", FALLS)
def test_mechanical_vignetting_is_nearest_to_what_is_published(name: str, module: Any) -> None:
    values = said(REAL[name])

    def miss(mechanical: float) -> float:
        falls = FALLS[name]
        return sum((fall(module, values, mechanical, f_stop) - stops) ** 2 for f_stop, stops, _ in falls)

    best = optimize.minimize_scalar(miss, bounds=(0.0, 0.95), method="bounded").x
    assert values["vignetting.mechanical"] == pytest.approx(best, abs=1e-3)
    assert values["vignetting.fastest_f_stop"] == values["camera.dof.aperture_fstop"] == FALLS[name][0][0]


@pytest.mark.parametrize("name", FALLS)
def test_natural_vignetting_is_the_published_one(name: str) -> None:
    values = said(REAL[name])
    cosine_4 = math.cos(math.atan(CORNER / values["camera.lens"])) ** 4
    light = 1.0 - values["vignetting.natural"] * (1.0 - cosine_4)
    assert -math.log2(light) == pytest.approx(NATURAL.get(name, -math.log2(cosine_4)), abs=3e-3)


def test_apodisation_leaves_the_light_of_the_t_stop() -> None:
    density = said(REAL["Minolta STF 135 mm f/2.8 T4.5"])["pupil.apodisation"]
    radius = (np.arange(20_000) + 0.5) / 20_000
    share = float(np.mean(2.0 * radius * np.exp(-density * radius**2)))
    assert 2.8 / math.sqrt(share) == pytest.approx(4.5, abs=0.005)
    # Stopped down to f/5.7 within the same filter: T6.7 by the maker.
    stopped = 2.8 / 5.7
    share = float(np.mean(2.0 * radius * np.exp(-density * (stopped * radius) ** 2)))
    assert 5.7 / math.sqrt(share) == pytest.approx(6.5, abs=0.05)


def test_obstructions_follow_from_what_is_published() -> None:
    spot = said(REAL["Leica Thambar-M 90 mm f/2.2 with Centre Spot"])["pupil.obstruction"]
    assert spot * 90.0 / 2.2 == pytest.approx(13.0, abs=0.03)
    mirror = said(REAL["Nikon Reflex-Nikkor 500 mm f/8"])["pupil.obstruction"]
    assert 7.0 / math.sqrt(1.0 - mirror**2) == pytest.approx(8.0, abs=0.005)
