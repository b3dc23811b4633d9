"""The interface in other languages, through Blender's own mechanism.

A module for each language has a dictionary from what the code says to what the artist reads. What Blender
draws by itself, such as labels, names and tooltips, it looks up there by itself; what the code puts together
is looked up before values are filled in.
"""

from __future__ import annotations

import bpy

from .language_de import GERMAN

LANGUAGES: dict[str, dict[str, str]] = {"de": GERMAN}
"""The dictionaries by Blender's name of the language; a country, as in ``de_DE``, is looked up without it."""

_PACKAGE = __package__.rpartition(".")[0]
OWN = "Potmesil Camera"
"""Context of names that Blender has too, and translates for another meaning."""

_CONTEXTS = ("*", "Operator", OWN)
"""Where Blender looks: for what is written on operators' buttons in the second, else in the first."""


def register() -> None:
    """Let Blender find our texts in every language that there is."""
    bpy.app.translations.register(
        _PACKAGE,
        {
            language: {(context, text): own for text, own in texts.items() for context in _CONTEXTS}
            for language, texts in LANGUAGES.items()
        },
    )


def unregister() -> None:
    """Take them out again."""
    bpy.app.translations.unregister(_PACKAGE)
