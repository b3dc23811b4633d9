"""Special effects as the command line and JSON files say them."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import pytest

from potmesil_addon import cli
from potmesil_addon.effect_options import described, read_effects, with_options
from potmesil_addon.effects import KINDS, UNITS, Effects, StarFilter, effects_from_json
from potmesil_addon.errors import InputError, SettingsError
from potmesil_addon.preview import settings_from_json, settings_to_json
from potmesil_addon.process import ProcessSettings

from .helpers import ROOT


def effects(*said: str, base: Any = None, frame: int | None = None) -> Effects:
    return effects_from_json(with_options(base or {}, said, frame))


def test_a_name_switches_an_effect_on_and_off() -> None:
    assert effects("star") == Effects(star=StarFilter())
    assert effects("star", "star=off") == Effects()
    assert effects("grain", "star=off").grain is not None


def test_fields_are_in_the_units_that_people_type() -> None:
    found = effects(
        "star.rotation=30", "star.groove_width=5", "star.lines=4", "pupil.spherical_aberration=-0.2"
    )
    assert found.star == StarFilter(lines=4, rotation=30 * UNITS["deg"], groove_width=5 * UNITS["um"])
    assert found.pupil is not None
    assert found.pupil.spherical_aberration == pytest.approx(-0.2e-3)


def test_numbers_have_keys_and_whole_ones_step() -> None:
    said = "star.rotation=1=0,11=90", "star.lines=1=2,11=4"
    turned = effects(*said, frame=6).star
    assert turned is not None
    assert (turned.rotation, turned.lines) == (pytest.approx(math.radians(45.0)), 3)
    with pytest.raises(SettingsError, match="frames"):
        effects(*said)


def test_an_option_leaves_the_panels_other_fields() -> None:
    panel = {"star": {"lines": 4, "strength": 0.5}, "grain": {}}
    found = effects("star.strength=0.25", "grain=off", base=panel)
    assert found == Effects(star=StarFilter(lines=4, strength=0.25))
    assert panel == {"star": {"lines": 4, "strength": 0.5}, "grain": {}}


def test_choices_flags_colours_and_paths() -> None:
    found = effects(
        "distortion.model=nuke",
        "diffraction.spectral=off",
        "exposure.tint=1,0.9,0.8",
        "pupil.image=a b=c.png",
    )
    assert found.distortion is not None
    assert found.distortion.model == "nuke"
    assert found.diffraction is not None
    assert found.diffraction.spectral is False
    assert found.exposure is not None
    assert found.exposure.tint == (1.0, 0.9, 0.8)
    assert found.pupil is not None
    assert found.pupil.image == "a b=c.png"


WRONG = {
    "glitter": "no effect 'glitter'",
    "star.colour=1": "no 'colour'",
    "star=4": "sets no field",
    "star.lines": "no value",
    "star.lines=2.5": "whole number",
    "star.lines=9": "from 1 to 8",
    "star.lines=1=2.5": "whole number",
    "star.rotation=": "star.rotation",
    "star.rotation=nan": "finite",
    "star.strength=x": "neither a number",
    "star.groove_width=0": "from 1 to 10000 um",
    "diffraction.spectral=maybe": "on or off",
    "exposure.tint=1,2": "three numbers",
    "exposure.tint=red": "three numbers",
    "distortion.model=fish": "one of",
}


@pytest.mark.parametrize("said", WRONG)
def test_what_is_wrong_is_said_in_one_sentence(said: str) -> None:
    with pytest.raises(SettingsError, match=WRONG[said]) as caught:
        effects(said)
    assert "\n" not in str(caught.value)


def test_a_file_holds_what_people_type(tmp_path: Path) -> None:
    path = tmp_path / "effects.json"
    path.write_text('{"star": {"lines": 3, "rotation": 90}, "grain": {}, "noise": null}')
    found = effects_from_json(read_effects(path))
    assert found.star == StarFilter(lines=3, rotation=90 * UNITS["deg"])
    assert found.grain is not None
    assert found.noise is None


@pytest.mark.parametrize(
    ("text", "error", "match"),
    [
        ("{", InputError, "no JSON"),
        ("[" * 100_000, InputError, "no JSON"),
        ("[1]", InputError, "object"),
        ('{"star": 1}', InputError, "object"),
        ('{"star": {"lines": "4"}}', SettingsError, "cannot be"),
        ('{"star": {"lines": true}}', SettingsError, "cannot be"),
        ('{"star": {"strength": NaN}}', InputError, "NaN is no number"),
        ('{"star": {"strength": 1e999}}', InputError, "too large"),
        ('{"star": {}, "star": null}', InputError, "twice"),
        ('{"st\\nar": {}}', SettingsError, r"effect 'st\\nar'"),
        ('{"exposure": {"tint": 1}}', SettingsError, "cannot be"),
        ('{"exposure": {"tint": [1, 1, -1]}}', SettingsError, "three numbers"),
        ('{"diffraction": {"spectral": 1}}', SettingsError, "cannot be"),
        ('{"pupil": {"image": 1}}', SettingsError, "cannot be"),
        ('{"lens": {}}', SettingsError, "no effect"),
        ('{"star": {"lines": 1%s}}' % ("0" * 400), SettingsError, "cannot be"),
        ('{"star": {"strength": 1%s}}' % ("0" * 400), SettingsError, "cannot be"),
        ('{"exposure": {"tint": [true, 1, 1]}}', SettingsError, "cannot be"),
    ],
)
def test_wrong_files_are_refused(tmp_path: Path, text: str, error: type[Exception], match: str) -> None:
    path = tmp_path / "effects.json"
    path.write_text(text)
    with pytest.raises(error, match=match):
        read_effects(path)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_effects(tmp_path / "no.json")


def test_the_list_names_every_field_with_its_range(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["effects", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in rows] == [
        f"{name}.{item.name}" for name, kind in KINDS.items() for item in fields(kind)
    ]
    groove = next(row for row in rows if row["name"] == "star.groove_width")
    assert (groove["unit"], groove["default"], groove["least"], groove["most"]) == ("um", 20.0, 1.0, 10_000.0)
    # What the list says is what can be typed.
    for row in rows:
        if row["least"] is not None:
            found = asdict(effects(f"{row['name']}={row['least']}"))
            name, field = row["name"].split(".")
            assert found[name][field] == pytest.approx(row["least"] * UNITS[row["unit"]])
    assert cli.main(["effects"]) == 0
    assert "star.lines" in capsys.readouterr().out


def test_the_documentation_names_every_field() -> None:
    text = (ROOT / "docs" / "effects.md").read_text(encoding="utf-8")
    for row in described():
        assert f"`{row['name']}`" in text, row["name"]


def test_effects_survive_as_text() -> None:
    settings = ProcessSettings(effects=effects("star.lines=3", "exposure.tint=1,0.5,0.25"), frame=7)
    assert settings_from_json(json.loads(json.dumps(settings_to_json(settings)))) == settings
