"""The box of the pre-flight check: what stands in the way of a good picture, each with its fix."""

from __future__ import annotations

import bpy
from bpy.app.translations import pgettext_iface as iface_

from ..operators.fix import fixes_of_all, label_of
from ..operators.scene import scene_facts
from ..potmesil_addon.preflight import Fix, check_scene
from .draw import sentence

_ICONS = {"error": "CANCEL", "warning": "ERROR", "note": "INFO"}

_CHARACTER_WIDTH = 6.2
"""Pixels a character at the standard interface scale."""

_BESIDE_WIDTH = 90.0
"""Pixels that icons, borders and margins take where a label and a button stand in one line."""


class CheckPanel:
    """The box as a panel of its own, for the tabs that have Render."""

    bl_label = "Pre-Flight"

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        """Show how bad it is, also while the panel is closed."""
        findings = check_scene(scene_facts(context.scene))
        self.layout.label(text="", icon=_ICONS[findings[0].severity] if findings else "CHECKMARK")

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the box."""
        draw_check(self.layout, context)


def draw_check(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the findings, each with a button that puts it right, and one button for all.

    Parameters
    ----------
    layout : UILayout
        Where.
    context : Context
        Its scene is checked.
    """
    findings = check_scene(scene_facts(context.scene))
    box = layout.box()
    if all(finding.severity == "note" for finding in findings):
        box.label(text="Ready to Render", icon="CHECKMARK")
    buttons = box.column()
    buttons.enabled = not context.window_manager.potmesil_camera.running
    for finding in findings:
        column = buttons.column(align=True)
        row = column.row()
        row.label(text=finding.title, icon=_ICONS[finding.severity])
        beside = finding.fix is not None and _fits(
            context, iface_(finding.title) + iface_(label_of(finding.fix), "Operator")
        )
        if finding.fix is not None and beside:
            _button(row, finding.fix)
        sentence(column, context, finding.text)
        if finding.fix is not None and not beside:
            _button(column.row(), finding.fix)
    if len(fixes_of_all(findings)) > 1:
        buttons.operator("potmesil.fix_all", icon="CHECKMARK")


def _button(layout: bpy.types.UILayout, fix: Fix) -> None:
    """Draw a small button on the right."""
    row = layout.row()
    row.alignment = "RIGHT"
    row.operator("potmesil.fix", text=label_of(fix)).fix = fix


def _fits(context: bpy.types.Context, words: str) -> bool:
    """Return whether a label and a button with these words stand in one line."""
    scale = context.preferences.system.ui_scale
    return context.region.width > scale * (_CHARACTER_WIDTH * len(words) + _BESIDE_WIDTH)
