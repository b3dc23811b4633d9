"""Pictures written as the scene's output settings say."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import bpy
from bpy.app.translations import pgettext_rpt as rpt_

from ..potmesil_addon.errors import InputError, OutputError
from ..potmesil_addon.files import refuse_cut, whole_file
from .scene import is_writable


def output_path(scene: bpy.types.Scene, frame: int) -> Path:
    """Return where the picture of a frame belongs, as the output settings say.

    Raises
    ------
    InputError
        If the path has variables that Blender does not know.
    """
    try:
        return Path(bpy.path.abspath(scene.render.frame_path(frame=frame)))
    except RuntimeError as error:
        # "Error: Parse errors in path '...':" and a line for each.
        reason = " ".join(line.strip(" -") for line in str(error).splitlines()[1:])
        raise InputError(
            rpt_("The output path is not valid: {reason} Correct it in the output properties.").format(
                reason=reason
            )
        ) from error


def refuse_output(scene: bpy.types.Scene, *, layered: bool = False) -> None:
    """Raise InputError where frames cannot be written as the output settings say.

    Parameters
    ----------
    scene : Scene
        The scene.
    layered : bool
        Whether the picture may have several layers.
    """
    render = scene.render
    if render.is_movie_format:
        raise InputError(
            "Frames are written as images and not as a movie; choose an image format in the output "
            "properties, or add a stage."
        )
    if render.image_settings.file_format == "OPEN_EXR_MULTILAYER" and not layered:
        raise InputError(
            "The picture has one layer; choose OpenEXR, not OpenEXR MultiLayer, in the output properties, or "
            "add a stage."
        )
    if render.filepath.startswith("//") and not bpy.data.filepath:
        raise InputError(
            "The output path is relative to a .blend file that was never saved; save the file, or choose "
            "another output path."
        )
    folder = output_path(scene, scene.frame_start).parent
    if not is_writable(folder):
        text = rpt_("Cannot write frames into '{folder}'; choose another output path.")
        raise OutputError(text.format(folder=folder))


def save_image(
    image: bpy.types.Image,
    scene: bpy.types.Scene,
    path: Path,
    texts: Mapping[str, str] | None = None,
) -> None:
    """Write an image in the format and with the view transform of a scene's output settings.

    Parameters
    ----------
    image : Image
        The image.
    scene : Scene
        Whose settings.
    path : Path
        The file; written whole or not at all.
    texts : mapping of str to str, optional
        What an EXR or PNG file's header says beside what Blender writes there.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    with whole_file(path) as part:
        image.save_render(str(part), scene=scene)
        if texts and path.suffix.lower() in (".exr", ".png"):
            from ..potmesil_addon import exr, png  # noqa: PLC0415 - see kernels

            # Blender does not always say where a full disk cut an image short.
            refuse_cut(part)
            stamp = exr.stamp if path.suffix.lower() == ".exr" else png.stamp
            stamp(part, texts)
