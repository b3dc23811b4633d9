"""Potmesil Camera: depth of field after the render."""


def register() -> None:
    """Add the extension's properties, operators, panels and command to Blender."""
    # Blender's modules are imported here and not above, so that tools can import the folder without it.
    from . import operators, ui  # noqa: PLC0415

    ui.register()
    operators.register()


def unregister() -> None:
    """Take out all that `register` added, in reverse."""
    from . import operators, ui  # noqa: PLC0415

    operators.unregister()
    ui.unregister()
