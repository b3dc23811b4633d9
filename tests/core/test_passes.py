"""Channel names of Blender 4.x and 5.x, of stereo views and of other programs."""

from __future__ import annotations

import pytest

from potmesil_addon.passes import LIGHT_PASSES, ChannelName, parse_channel


@pytest.mark.parametrize(
    ("channel", "layer", "name", "component"),
    [
        # Plain files.
        ("R", "", "combined", 0),
        ("G", "", "combined", 1),
        ("B", "", "combined", 2),
        ("A", "", "combined", 3),
        ("Z", "", "depth", 0),
        # Blender 4.x
        ("ViewLayer.Combined.R", "ViewLayer", "combined", 0),
        ("ViewLayer.Combined.A", "ViewLayer", "combined", 3),
        ("ViewLayer.Depth.Z", "ViewLayer", "depth", 0),
        ("ViewLayer.IndexOB.X", "ViewLayer", "object_index", 0),
        ("ViewLayer.Vector.X", "ViewLayer", "vector", 0),
        ("ViewLayer.Vector.Y", "ViewLayer", "vector", 1),
        ("ViewLayer.Vector.Z", "ViewLayer", "vector", 2),
        ("ViewLayer.Vector.W", "ViewLayer", "vector", 3),
        # Blender 5.x
        ("ViewLayer.Object Index.X", "ViewLayer", "object_index", 0),
        ("ViewLayer.Object Index.V", "ViewLayer", "object_index", 0),
        ("ViewLayer.Depth.V", "ViewLayer", "depth", 0),
        ("Depth.V", "", "depth", 0),
        ("Color.R", "", "combined", 0),
        # A layer may have any name.
        ("Layer.001.Combined.G", "Layer.001", "combined", 1),
        ("a.b.c.Depth.Z", "a.b.c", "depth", 0),
        ("My Layer.Vector.W", "My Layer", "vector", 3),
        # Another program's layer without a pass.
        ("beauty.R", "", "combined", 0),
        ("fg.R", "fg", "combined", 0),
        ("fg.Z", "fg", "depth", 0),
        # Cryptomatte: Blender, Arnold, the specification's own names, Redshift and V-Ray.
        ("ViewLayer.CryptoObject00.r", "ViewLayer", "cryptomatte_object", 0),
        ("ViewLayer.CryptoObject00.a", "ViewLayer", "cryptomatte_object", 3),
        ("ViewLayer.CryptoObject01.g", "ViewLayer", "cryptomatte_object", 5),
        ("ViewLayer.CryptoAsset00.b", "ViewLayer", "cryptomatte_asset", 2),
        ("ViewLayer.CryptoMaterial01.a", "ViewLayer", "cryptomatte_material", 7),
        ("crypto_object00.R", "", "cryptomatte_object", 0),
        ("crypto_asset01.A", "", "cryptomatte_asset", 7),
        ("uCryptoMaterial00.green", "", "cryptomatte_material", 1),
        ("Cryptomatte00.B", "", "cryptomatte", 2),
    ],
)
def test_channel_of_a_pass_we_use(channel: str, layer: str, name: str, component: int) -> None:
    assert parse_channel(channel) == ChannelName(layer, name, component)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "channel",
    [
        "ViewLayer.Position.X",
        "ViewLayer.Mist.V",
        "forward.left.u",
        "disparityL.x",
        "Y",
        "ViewLayer.Combined.Q",
        "ViewLayer.Depth.Q",
        "ViewLayer.CryptoObject02.r",
        "ViewLayer.CryptoObject00.x",
        "ViewLayer.CryptoObject.x",
        "",
        ".",
    ],
)
def test_other_channels_have_no_name(channel: str) -> None:
    assert parse_channel(channel).name is None


def test_colored_passes_are_layers_of_their_own() -> None:
    """They must not be taken for the layer's own picture."""
    assert parse_channel("ViewLayer.Diffuse Color.G").layer != "ViewLayer"


@pytest.mark.parametrize(
    ("channel", "name"),
    [
        ("ViewLayer.Noisy Image.R", "noisy"),
        ("ViewLayer.Glossy Direct.R", "glossy_direct"),
        ("ViewLayer.GlossInd.B", "glossy_indirect"),
        ("ViewLayer.Transmission Color.R", "transmission_color"),
        ("ViewLayer.TransCol.R", "transmission_color"),
        ("ViewLayer.Normal.Z", "normal"),
    ],
)
def test_passes_that_light_is_parted_by_are_known(channel: str, name: str) -> None:
    parsed = parse_channel(channel)
    assert parsed.layer == "ViewLayer"
    assert parsed.name == name
    assert name in LIGHT_PASSES


VIEWS = ("left", "right")


@pytest.mark.parametrize(
    ("channel", "layer", "name"),
    [
        ("ViewLayer.Combined.left.R", "ViewLayer", "combined"),
        ("ViewLayer.Combined.right.R", "ViewLayer.right", "combined"),
        ("ViewLayer.Depth.right.Z", "ViewLayer.right", "depth"),
        ("left.R", "", "combined"),
        ("right.R", "right", "combined"),
        ("R", "", "combined"),
        ("right.Z", "right", "depth"),
    ],
)
def test_views_other_than_the_first_are_kept_apart(channel: str, layer: str, name: str) -> None:
    parsed = parse_channel(channel, VIEWS)
    assert (parsed.layer, parsed.name) == (layer, name)


def test_without_views_left_is_a_layer() -> None:
    assert parse_channel("left.R").layer == "left"
