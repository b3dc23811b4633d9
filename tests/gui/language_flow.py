"""Run inside a Blender with a window and languages: looks at what stands in the panels in German.

blender --enable-event-simulate --python language_flow.py -- FOLDER
"""

from __future__ import annotations

import json
import subprocess
import sys
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

FOLDER = Path(sys.argv[sys.argv.index("--") + 1])
SEEN: dict[str, Any] = {"errors": []}

TABS = ("RENDER", "OUTPUT", "DATA")
"""Where our panels stand among the properties."""


def shot(name: str) -> None:
    """Save what an artist would see."""
    print(f"{name}.png", flush=True)
    subprocess.run(["import", "-window", "root", str(FOLDER / f"{name}.png")], check=True)


def looked_up() -> dict[str, str]:
    """Return what Blender finds now for a label, a tooltip, the text of a button and a report."""
    find = bpy.app.translations
    return {
        "label": find.pgettext_iface("Aperture Image"),
        "tooltip": find.pgettext_tip("What a point out of focus becomes"),
        "button": find.pgettext_iface("Set Up Passes", "Operator"),
        "report": find.pgettext_rpt("Frame {frame} has no samples yet; press Render to make them."),
        "choice": bpy.types.UILayout.enum_item_name(bpy.context.scene.potmesil_camera, "psf", "lommel"),
    }


def story() -> Iterator[float]:
    """Look at all panels in German, without the extension, and with it again."""
    SEEN["locales"] = [name for name in bpy.app.translations.locales if name.startswith("de")]
    if not SEEN["locales"]:
        return
    bpy.context.preferences.view.language = SEEN["locales"][0]
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    bpy.context.view_layer.objects.active = scene.camera
    area = max(bpy.context.window_manager.windows[0].screen.areas, key=lambda area: area.width * area.height)
    area.ui_type = "PROPERTIES"
    yield 1.0
    # Hides the other panels, which ours come after.
    area.spaces.active.search_filter = "Potmesil"
    for tab in TABS:
        area.spaces.active.context = tab
        yield 1.0
        shot(f"german_{tab.lower()}")
    SEEN["looked_up"] = looked_up()
    camera, scene.camera = scene.camera, None
    try:
        bpy.ops.potmesil.render()
    except RuntimeError as error:
        SEEN["refused"] = str(error)
    yield 1.0
    shot("german_error")
    scene.camera = camera
    name = next(name for name in sys.modules if name.endswith(".potmesil_camera"))
    bpy.ops.preferences.addon_disable(module=name)
    SEEN["without"] = bpy.app.translations.pgettext_iface("Aperture Image")
    bpy.ops.preferences.addon_enable(module=name)
    SEEN["again"] = looked_up()


def main() -> None:
    bpy.context.preferences.view.show_splash = False
    steps = story()

    def tick() -> float | None:
        try:
            return next(steps)
        except StopIteration:
            pass
        except Exception:
            SEEN["errors"].append(traceback.format_exc())
        (FOLDER / "seen.json").write_text(json.dumps(SEEN))
        bpy.ops.wm.quit_blender()
        return None

    bpy.app.timers.register(tick, first_interval=3.0, persistent=True)


main()
