"""The panels of the special effects: the lens's character on the Data tab, filters and film on Render."""

from __future__ import annotations

import math
from typing import Any

import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_

from ..operators import scene as adapter
from ..operators.effects import CLIP_COEFFICIENTS, clip_distortion
from . import draw, presets
from .translations import OWN


class _CameraTab:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "data"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Show where Blender shows a camera."""
        return context.camera is not None


class _RenderTab:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"


class _EffectPanel:
    """A panel with the switch of an effect in its header and the effect's settings below."""

    bl_options = {"DEFAULT_CLOSED"}
    effect: str

    def draw_header(self, context: bpy.types.Context) -> None:
        """Draw the switch."""
        self.layout.prop(self._group(context), "use", text="")

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the settings, which count where the effect is on."""
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = True
        group = self._group(context)
        layout.active = group.use
        self.draw_effect(layout, context, group)

    def draw_effect(self, layout: bpy.types.UILayout, context: bpy.types.Context, group: Any) -> None:
        """Draw the settings of the effect."""
        raise NotImplementedError

    def _group(self, context: bpy.types.Context) -> Any:
        return getattr(context.scene.potmesil_camera.effects, self.effect)


class POTMESIL_PT_lens_character(_CameraTab, bpy.types.Panel):
    """What a real lens does that the ideal one does not."""

    bl_label = "Lens Character"
    bl_parent_id = "POTMESIL_PT_camera"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        """Draw the menu of lenses."""
        del context
        presets.POTMESIL_PT_lens_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw nothing: the effects have panels of their own."""


class _LensPanel(_EffectPanel, _CameraTab):
    bl_parent_id = "POTMESIL_PT_lens_character"


class POTMESIL_PT_pupil(_LensPanel, bpy.types.Panel):
    """The aperture beyond Blender's iris."""

    bl_label = "Aperture Shape"
    effect = "pupil"

    def draw_effect(self, layout: bpy.types.UILayout, context: bpy.types.Context, group: Any) -> None:
        """Draw the aperture's outline and what is inside."""
        pictured = bool(group.image)
        column = layout.column(align=True)
        column.active = not pictured
        row = column.row()
        row.active = context.camera.dof.aperture_blades >= _LEAST_BLADES
        row.prop(group, "blade_curvature")
        column.prop(group, "obstruction")
        layout.prop(group, "image")
        column = layout.column(align=True)
        column.prop(group, "apodisation")
        column.prop(group, "spherical_aberration", text="Spherical")
        if group.use and context.scene.potmesil_camera.psf == "lommel":
            draw.sentence(
                layout,
                context,
                "Diffraction as Aperture Image is for a round and clear aperture only; choose Geometric.",
                "INFO",
            )


class POTMESIL_PT_focal_surface(_LensPanel, bpy.types.Panel):
    """The tilted or bent surface that is in focus."""

    bl_label = "Focal Surface"
    effect = "focal_surface"

    def draw_effect(self, layout: bpy.types.UILayout, context: bpy.types.Context, group: Any) -> None:
        """Draw the lens's tilt and its field's curvature."""
        column = layout.column(align=True)
        column.prop(group, "tilt")
        column.prop(group, "swing")
        tilted = math.hypot(math.sin(group.tilt), math.sin(group.swing))
        if tilted > 0.0:
            hinge = context.camera.lens / 1000.0 / tilted
            _fact(column, n_("Hinge At"), adapter.as_length(context.scene, hinge))
        layout.prop(group, "curvature")


class POTMESIL_PT_chromatic(_LensPanel, bpy.types.Panel):
    """Colours that are imaged elsewhere."""

    bl_label = "Chromatic Aberration"
    effect = "chromatic"

    def draw_effect(self, layout: bpy.types.UILayout, context: bpy.types.Context, group: Any) -> None:
        """Draw the longitudinal and the lateral aberration."""
        del context
        column = layout.column(align=True)
        column.prop(group, "focus_red")
        column.prop(group, "focus_blue", text="Blue")
        column = layout.column(align=True)
        column.prop(group, "size_red")
        column.prop(group, "size_blue", text="Blue")


class POTMESIL_PT_vignetting(_LensPanel, bpy.types.Panel):
    """Dark corners."""

    bl_label = "Vignetting"
    effect = "vignetting"

    def draw_effect(self, layout: bpy.types.UILayout, context: bpy.types.Context, group: Any) -> None:
        """Draw the natural and the mechanical vignetting."""
        del context
        layout.prop(group, "natural")
        column = layout.column(align=True)
        column.prop(group, "mechanical")
        row = column.row()
        row.active = group.mechanical > 0.0
        row.prop(group, "fastest_f_stop")


class POTMESIL_PT_distortion(_LensPanel, bpy.types.Panel):
    """Bent lines."""

    bl_label = "Distortion"
    bl_translation_context = OWN
    effect = "distortion"

    def draw_effect(self, layout: bpy.types.UILayout, context: bpy.types.Context, group: Any) -> None:
        """Draw the formula and its coefficients, or those of a clip."""
        del context
        layout.prop(group, "clip")
        if group.clip is not None:
            _clip(layout, group.clip)
            return
        layout.prop(group, "model")
        column = layout.column(align=True)
        for name in CLIP_COEFFICIENTS[group.model]:
            column.prop(group, name)


class POTMESIL_PT_filters(_RenderTab, bpy.types.Panel):
    """What filters before the lens, and the film or sensor behind it, do to the picture."""

    bl_label = "Filters and Film"
    bl_parent_id = "POTMESIL_PT_render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        """Draw the menu of filters and films."""
        del context
        presets.POTMESIL_PT_effects_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw nothing: the effects have panels of their own."""


class _FilterPanel(_EffectPanel, _RenderTab):
    bl_parent_id = "POTMESIL_PT_filters"


class POTMESIL_PT_diffraction(_FilterPanel, bpy.types.Panel):
    """Stars of a lens that is stopped down."""

    bl_label = "Diffraction"
    effect = "diffraction"

    def draw_effect(self, layout: bpy.types.UILayout, context: bpy.types.Context, group: Any) -> None:
        """Draw how much is diffracted, and where."""
        del context
        layout.prop(group, "strength")
        layout.prop(group, "f_stop")
        layout.prop(group, "spectral")


class POTMESIL_PT_star(_FilterPanel, bpy.types.Panel):
    """Streaks of a grooved filter."""

    bl_label = "Star Filter"
    effect = "star"

    def draw_effect(self, layout: bpy.types.UILayout, context: bpy.types.Context, group: Any) -> None:
        """Draw the grooves, and how many points their stars have."""
        del context
        column = layout.column(align=True)
        column.prop(group, "lines")
        _fact(column, n_("Star Points"), str(2 * group.lines))
        layout.prop(group, "rotation")
        column = layout.column(align=True)
        column.prop(group, "strength")
        column.prop(group, "groove_width")


class POTMESIL_PT_image_filter(_FilterPanel, bpy.types.Panel):
    """A picture in place of each light."""

    bl_label = "Image Filter"
    effect = "image_filter"

    def draw_effect(self, layout: bpy.types.UILayout, context: bpy.types.Context, group: Any) -> None:
        """Draw the picture and its place."""
        layout.prop(group, "image")
        if group.use and not group.image:
            draw.sentence(layout, context, "Choose a picture first.", "INFO")
        column = layout.column(align=True)
        column.active = bool(group.image)
        column.prop(group, "strength")
        column.prop(group, "size")
        column.prop(group, "rotation")


class POTMESIL_PT_exposure(_FilterPanel, bpy.types.Panel):
    """How bright the film is exposed."""

    bl_label = "Exposure"
    effect = "exposure"

    def draw_effect(self, layout: bpy.types.UILayout, context: bpy.types.Context, group: Any) -> None:
        """Draw speed and filters, and how much brighter or darker the picture becomes."""
        layout.prop(group, "sensitivity")
        layout.prop(group, "normal_ev")
        column = layout.column(align=True)
        column.prop(group, "density")
        column.prop(group, "tint")
        stops = brightness(context.scene)
        if stops is not None:
            _fact(layout, n_("Brightness"), iface_("{stops:+.1f} Stops").format(stops=stops))


class POTMESIL_PT_grain(_FilterPanel, bpy.types.Panel):
    """The film's grain."""

    bl_label = "Film Grain"
    effect = "grain"

    def draw_effect(self, layout: bpy.types.UILayout, context: bpy.types.Context, group: Any) -> None:
        """Draw what the emulsion is like."""
        del context
        column = layout.column(align=True)
        column.prop(group, "granularity")
        column.prop(group, "size")
        layout.prop(group, "color")
        layout.prop(group, "seed")


class POTMESIL_PT_noise(_FilterPanel, bpy.types.Panel):
    """The sensor's noise."""

    bl_label = "Sensor Noise"
    effect = "noise"

    def draw_effect(self, layout: bpy.types.UILayout, context: bpy.types.Context, group: Any) -> None:
        """Draw what the sensor is like."""
        del context
        column = layout.column(align=True)
        column.prop(group, "full_well")
        column.prop(group, "read_noise")
        layout.prop(group, "seed")


_LEAST_BLADES = 3
"""With fewer Blender's iris is round."""


def brightness(scene: bpy.types.Scene) -> float | None:
    """Return by how many stops the scene's exposure brightens the picture, None where nothing is exposed.

    Parameters
    ----------
    scene : Scene
        The scene.

    Returns
    -------
    float or None
        Stops, tint left out: ``normal_ev - density - log2(N^2 / t) + log2(S / 100)`` with f-stop N,
        exposure time t in seconds and ISO speed S.
    """
    camera, said = scene.camera, adapter.scene_exposure(scene)
    # As long as a slit uncovers a point of the film.
    time = (said.exposure_time or 0.0) * (1.0 if said.slit is None else said.slit.width)
    if camera is None or camera.type != "CAMERA" or time <= 0.0:
        return None
    own = scene.potmesil_camera.effects.exposure
    value = math.log2(camera.data.dof.aperture_fstop**2 / time) - math.log2(own.sensitivity / 100.0)
    return float(own.normal_ev - own.density - value)


def _clip(layout: bpy.types.UILayout, clip: bpy.types.MovieClip) -> None:
    """Draw what a clip's camera says, which is changed in the movie clip editor."""
    camera = clip.tracking.camera
    said = clip_distortion(clip)
    column = layout.column(align=True)
    column.active = False
    _fact(column, n_("Model"), layout.enum_item_name(camera, "distortion_model", camera.distortion_model))
    for name in CLIP_COEFFICIENTS[said["model"]]:
        _fact(column, name.upper(), f"{said[name]:.4f}")


def _fact(layout: bpy.types.UILayout, name: str, value: str) -> None:
    """Draw a name and its value as a setting that cannot be changed."""
    split = layout.split(factor=0.4)
    left = split.row()
    left.alignment = "RIGHT"
    left.label(text=name)
    split.label(text=value, translate=False)


CLASSES = (
    POTMESIL_PT_lens_character,
    POTMESIL_PT_pupil,
    POTMESIL_PT_focal_surface,
    POTMESIL_PT_chromatic,
    POTMESIL_PT_vignetting,
    POTMESIL_PT_distortion,
    POTMESIL_PT_filters,
    POTMESIL_PT_diffraction,
    POTMESIL_PT_star,
    POTMESIL_PT_image_filter,
    POTMESIL_PT_exposure,
    POTMESIL_PT_grain,
    POTMESIL_PT_noise,
)
