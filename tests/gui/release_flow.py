"""Run inside a Blender with a window: try the zip that is installed, write down what was found, and quit."""

from __future__ import annotations

import json
import sys
import traceback
from pathlib import Path
from typing import Any

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

import try_zip

ARCHIVE, FOLDER = (Path(word) for word in sys.argv[sys.argv.index("--") + 1 :])


def tick() -> None:
    found: dict[str, Any] = {"error": ""}
    try:
        found |= try_zip.try_zip(ARCHIVE, FOLDER, quick=True)
    except Exception:
        found["error"] = traceback.format_exc()
    found |= {"windows": len(bpy.context.window_manager.windows), "background": bpy.app.background}
    (FOLDER / "seen.json").write_text(json.dumps(found))
    bpy.ops.wm.quit_blender()


bpy.context.preferences.view.show_splash = False
bpy.app.timers.register(tick, first_interval=2.0)
