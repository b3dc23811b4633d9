"""Videos of pictures that are there, through Blender's own encoder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import bpy

from ..potmesil_addon.errors import InputError, PotmesilError, SettingsError
from ..potmesil_addon.files import whole_file
from ..potmesil_addon.frames import existing_frames, frame_path

CONTAINERS: Final = {".mp4": "MPEG4", ".mov": "QUICKTIME", ".mkv": "MKV", ".webm": "WEBM", ".avi": "AVI"}
"""Blender's names of the containers, by the ending of a video's name."""

_LINEAR: Final = (".exr", ".hdr")
"""Endings of pictures that the scene's view transform is for; others have gone through one."""


def write_movie(
    scene: bpy.types.Scene, source: Path, target: Path, frames: Sequence[int] | None = None
) -> None:
    """Make a video of pictures.

    Scene-linear pictures go through the scene's view transform, others stay as they are. Frame rate, and
    where the scene's output is a movie its codec, are the scene's.

    Parameters
    ----------
    scene : Scene
        The scene; it stays as it is.
    source : Path
        The pictures, ``#`` in the name standing for the frame's number.
    target : Path
        The video; written whole or not at all.
    frames : sequence of int, optional
        Their numbers, in rising order; by default all that are there.

    Raises
    ------
    SettingsError
        If the video's ending is not known, or the source has no ``#``.
    InputError
        If a picture is missing.
    PotmesilError
        If Blender cannot write the video.
    """
    if target.suffix.lower() not in CONTAINERS:
        raise SettingsError(f"'{target}' must end in {', '.join(CONTAINERS)}.")
    if "#" not in source.name:
        raise SettingsError(f"'{source}' needs a # for the frame's number.")
    if frames is None:
        frames = existing_frames(source)
        if not frames:
            raise InputError(f"There is no frame of '{source}'; # stands for the frame's number.")
        # A hole in the middle of a film is a lost frame, and no shorter film.
        frames = range(frames[0], frames[-1] + 1)
    pictures = [frame_path(source, frame) for frame in frames]
    for path in pictures:
        if not path.is_file():
            raise InputError(f"'{path}' is missing; make it first, or name the frames that are there.")
    cutting = _scene_of(scene, pictures)
    try:
        _choose_container(cutting, CONTAINERS[target.suffix.lower()])
        with whole_file(target) as part:
            cutting.render.filepath = str(part)
            try:
                bpy.ops.render.render(animation=True, scene=cutting.name)
            except RuntimeError as error:
                reason = " ".join(str(error).split())
                raise PotmesilError(f"Blender could not make the video: {reason}") from error
            if not part.is_file() or not part.stat().st_size:
                raise PotmesilError(f"Blender wrote nothing into '{target}'; choose another codec.")
    finally:
        bpy.data.scenes.remove(cutting)


def _scene_of(scene: bpy.types.Scene, pictures: Sequence[Path]) -> bpy.types.Scene:
    """Return a new scene that shows pictures one after the other, with another's output settings."""
    cutting = scene.copy()
    cutting.name = "Potmesil Movie"
    cutting.animation_data_clear()
    cutting.sequence_editor_clear()
    editor: Any = cutting.sequence_editor_create()
    # Blender 5.0 took the old name away.
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences
    strip = strips.new_image("Pictures", str(pictures[0]), channel=1, frame_start=1)
    for path in pictures[1:]:
        strip.elements.append(path.name)
    strip.frame_final_duration = len(pictures)
    render = cutting.render
    size = strip.elements[0]
    render.resolution_x, render.resolution_y = size.orig_width, size.orig_height
    render.resolution_percentage = 100
    render.use_sequencer, render.use_compositing, render.use_border = True, False, False
    render.use_overwrite, render.use_placeholder, render.use_multiview = True, False, False
    render.use_file_extension = True
    render.frame_map_old = render.frame_map_new = 100
    cutting.frame_start, cutting.frame_end, cutting.frame_step = 1, len(pictures), 1
    if pictures[0].suffix.lower() not in _LINEAR:
        cutting.view_settings.view_transform = "Standard"
        cutting.view_settings.look = "None"
        cutting.view_settings.exposure, cutting.view_settings.gamma = 0.0, 1.0
    return cutting


def _choose_container(scene: bpy.types.Scene, container: str) -> None:
    """Make a scene's output a movie in a container; what it had already stays."""
    render = scene.render
    was_movie = render.is_movie_format
    if hasattr(render.image_settings, "media_type"):
        # Blender 5.0 added the medium, which limits the formats and so comes first.
        render.image_settings.media_type = "VIDEO"
    render.image_settings.file_format = "FFMPEG"
    render.ffmpeg.format = container
    if not was_movie:
        render.image_settings.color_mode = "RGB"
        render.ffmpeg.codec = "WEBM" if container == "WEBM" else "H264"
        render.ffmpeg.constant_rate_factor = "HIGH"
        render.ffmpeg.audio_codec = "NONE"
