"""No path that stands in a file is ever opened."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from potmesil_addon.paths import CameraPath, MotionPaths, ObjectPath

from .helpers import importable, plain_channels, write_exr
from .test_schemas import BOX, MATRICES, TIMES

# The first reading compiles kernels and imports what is not there yet; of the second all is recorded.
PROCESS = """
import sys
from pathlib import Path
WATCHED = ("open", "os.", "socket.", "subprocess.", "compile", "exec")
recorded = None
def hook(event, arguments):
    if recorded is not None and event.startswith(WATCHED):
        recorded.append((event, str(arguments[0]) if arguments else ""))
sys.addaudithook(hook)
from potmesil_addon.cli import main
assert main(["process", *sys.argv[1:]]) == 0
Path(sys.argv[3]).unlink()
recorded = []
status = main(["process", *sys.argv[1:]])
said, recorded = recorded, None
assert status == 0
for event, name in said:
    print("event", event, name)
"""


def test_only_the_input_and_the_output_are_opened(tmp_path: Path) -> None:
    secrets = tmp_path / "secrets"
    secrets.mkdir()
    secret = secrets / "secret.exr"
    write_exr(secret, plain_channels(4, 4))
    (secrets / "curve.json").write_text("[[0, 1], [1, 1]]")
    thing = ObjectPath(str(secret), 1, TIMES, MATRICES, BOX)
    header = {
        **{
            name: str(secret)
            for name in ("File", "Camera", "Scene", "Note", "owner", "colorInteropID", "name")
        },
        **{f"potmesil:{name}": str(secret) for name in ("effects", "lens", "image", "presets", "path")},
        "potmesil:shutter": json.dumps({"frames": 0.5, "curve": str(secrets / "curve.json")}),
        "potmesil:motion": MotionPaths(CameraPath(TIMES[1:2], MATRICES[:1]), (thing,)).to_json(),
        "envmap": str(secret),
        "wrapmodes": str(secret),
    }
    folder = tmp_path / "work"
    folder.mkdir()
    source = write_exr(folder / "in.exr", plain_channels(12, 12), **header)
    # Without the lens hardly a kernel has to be compiled.
    words = ["--no-lens", "--no-motion", "--fade", "0.5"]
    done = subprocess.run(
        [sys.executable, "-c", PROCESS, str(source), "-o", str(folder / "out.exr"), *words],
        check=False,
        env=importable(),
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    events = [line.split(" ", 2)[1:] for line in done.stdout.splitlines() if line.startswith("event ")]
    assert ["open", str(source)] in events
    assert not [name for _, name in events if "secret" in name or "curve.json" in name]
    allowed = (str(folder), "/dev/null", "/proc/", "/sys/")
    # A number is a file that is open already.
    strangers = [
        (event, name) for event, name in events if not name.startswith(allowed) and not name.isdigit()
    ]
    assert not strangers
