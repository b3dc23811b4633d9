"""Names of render passes across Blender's versions and other programs: the one alias table."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final, Literal

PassName = Literal[
    "combined",
    "depth",
    "object_index",
    "vector",
    "cryptomatte_object",
    "cryptomatte_asset",
    "cryptomatte_material",
    "cryptomatte",
    "glossy_direct",
    "glossy_indirect",
    "glossy_color",
    "transmission_direct",
    "transmission_indirect",
    "transmission_color",
    "noisy",
    "normal",
    "patch",
    "astigmatism",
]

_ALIASES: Final[dict[str, PassName]] = {
    "Combined": "combined",
    "Image": "combined",
    "Color": "combined",
    "rgba": "combined",
    "beauty": "combined",
    "Depth": "depth",
    "depth": "depth",
    "Z": "depth",
    "Object Index": "object_index",  # Blender 5.0 and later
    "IndexOB": "object_index",  # Blender up to 4.5
    "Vector": "vector",
    "forward": "vector",  # only the way to the next frame
    "Glossy Direct": "glossy_direct",
    "GlossDir": "glossy_direct",  # these six in Blender up to 4.5
    "Glossy Indirect": "glossy_indirect",
    "GlossInd": "glossy_indirect",
    "Glossy Color": "glossy_color",
    "GlossCol": "glossy_color",
    "Transmission Direct": "transmission_direct",
    "TransDir": "transmission_direct",
    "Transmission Indirect": "transmission_indirect",
    "TransInd": "transmission_indirect",
    "Transmission Color": "transmission_color",
    "TransCol": "transmission_color",
    "Noisy Image": "noisy",
    "Normal": "normal",
    "Patch": "patch",
    "Astigmatism": "astigmatism",
}

LIGHT_PASSES: Final[tuple[PassName, ...]] = (
    "glossy_direct",
    "glossy_indirect",
    "glossy_color",
    "transmission_direct",
    "transmission_indirect",
    "transmission_color",
    "noisy",
    "normal",
)
"""Passes that light is parted by; a samples file holds what is made of them."""

FORWARD: Final = ("u", "v")
"""Components of a ``forward`` pass, which are a vector's last two."""

_COMPONENTS: Final[dict[PassName, tuple[str, ...]]] = {
    "combined": ("R", "G", "B", "A"),
    "depth": ("Z", "V"),
    "object_index": ("X", "V"),
    "vector": ("X", "Y", "Z", "W"),
    **dict.fromkeys(LIGHT_PASSES, ("R", "G", "B", "A")),
    "normal": ("X", "Y", "Z"),
    "patch": ("X",),
    "astigmatism": ("X", "Y"),
}

CRYPTOMATTES: Final[tuple[PassName, ...]] = (
    "cryptomatte_object",
    "cryptomatte_asset",
    "cryptomatte_material",
    "cryptomatte",
)
"""Cryptomatte passes, what tells surfaces apart best first; the last does not say of what it is."""

MAX_LEVELS: Final = 2
"""Numbered passes of a Cryptomatte that are read; each has the ids and coverages of two ranks."""

_CRYPTOMATTE: Final = re.compile(r"u?crypto(?:matte|_?(object|asset|material))([0-9]{2})", re.IGNORECASE)
"""A numbered pass: CryptoObject00 (Blender), crypto_object00 (Arnold), uCryptoObject00 (as specified)."""

_CRYPTOMATTE_COMPONENTS: Final = {
    name: index
    for index, names in enumerate((("r", "red"), ("g", "green"), ("b", "blue"), ("a", "alpha")))
    for name in names
}


@dataclass(frozen=True, slots=True)
class ChannelName:
    """What a channel's full name says.

    Parameters
    ----------
    layer : str
        View layer, with the stereo view appended where it is not the file's default one; may be empty.
    name : str or None
        Our name of the pass; ``None`` for a pass that the processors have no use for.
    component : int
        Which component of the pass. Of a Cryptomatte twice the rank for its id, and one more for its
        coverage.
    other_view : bool
        Whether it belongs to a stereo view that is not the file's default one.
    """

    layer: str
    name: PassName | None
    component: int
    other_view: bool = False


def parse_channel(channel: str, views: tuple[str, ...] = ()) -> ChannelName:
    """Split a channel's full name into view layer, pass and component.

    Parameters
    ----------
    channel : str
        Such as ``ViewLayer.Depth.Z``, ``Depth.V``, ``left.R`` or ``Z``.
    views : tuple of str
        The file's stereo views, the default one first.

    Returns
    -------
    ChannelName
        Its parts.
    """
    *tokens, component = channel.split(".")
    view = next((token for token in tokens if token in views), None)
    if view is not None:
        tokens.remove(view)
    name: PassName | None
    matte = _CRYPTOMATTE.fullmatch(tokens[-1]) if tokens else None
    if matte is not None:
        tokens.pop()
        name = _cryptomatte_name(matte[1])
    elif tokens and tokens[-1] in _ALIASES:
        name = _ALIASES[tokens.pop()]
    elif component in _COMPONENTS["combined"]:
        name = "combined"
    elif component == "Z":
        name = "depth"
    else:
        name = None
    layer = ".".join(tokens)
    other_view = False
    if view is not None and view != views[0]:
        other_view = True
        layer = f"{layer}.{view}" if layer else view
    if matte is not None:
        level, index = int(matte[2]), _CRYPTOMATTE_COMPONENTS.get(component.lower())
        if index is None or level >= MAX_LEVELS:
            return ChannelName(layer, None, 0, other_view)
        return ChannelName(layer, name, 4 * level + index, other_view)
    if name == "vector" and component in FORWARD:
        return ChannelName(layer, name, 2 + FORWARD.index(component), other_view)
    if name is None or component not in _COMPONENTS[name]:
        return ChannelName(layer, None, 0, other_view)
    index = _COMPONENTS[name].index(component)
    # Depth and index have one component under either of two names.
    return ChannelName(layer, name, 0 if name in ("depth", "object_index") else index, other_view)


def _cryptomatte_name(kind: str | None) -> PassName:
    """Return our name of a Cryptomatte of objects, assets or materials, in any case of letters."""
    wanted = "cryptomatte" if kind is None else f"cryptomatte_{kind.lower()}"
    return next(name for name in CRYPTOMATTES if name == wanted)
