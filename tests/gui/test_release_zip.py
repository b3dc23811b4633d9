"""The release's zip in a Blender with a window, in a fresh profile, with a network and without one."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
BLENDER = os.environ.get("BLENDER", "")
REPORT = "import sys, json; print(json.dumps({'python': 'cp%d%d' % sys.version_info[:2]}))"

sys.path.insert(0, str(ROOT / "tools"))

import build_extension  # noqa: E402
import fetch_wheels  # noqa: E402
import release  # noqa: E402
import try_zip  # noqa: E402

pytestmark = [
    pytest.mark.gui,
    pytest.mark.skipif(not BLENDER, reason="BLENDER names no Blender with a window"),
]


def run(words: tuple[str, ...], resources: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the Blender with a profile of its own."""
    return subprocess.run(
        [*words, BLENDER, *arguments],
        env={**os.environ, "BLENDER_USER_RESOURCES": str(resources)},
        # A Blender in a root of its own sees the project through this folder.
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=600.0,
        check=False,
    )


@pytest.fixture(scope="module")
def release_zip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The zip for the Python of that Blender, where its wheels were downloaded before."""
    folder = tmp_path_factory.mktemp("release")
    done = run((), folder, "-b", "--python-exit-code", "1", "--python-expr", REPORT)
    assert done.returncode == 0, done.stdout + done.stderr
    here = release.MACHINES.get((release.platform.system(), release.platform.machine()))
    name = f"{here}-{try_zip.found_in(done.stdout)['python']}"
    try:
        fetch_wheels.find_wheels(name)
    except (FileNotFoundError, ValueError):
        pytest.skip(f"the wheels are not here: tools/fetch_wheels.py {name} downloads them")
    return build_extension.build(folder, name)


@pytest.mark.parametrize("network", [True, False], ids=["network", "no network"])
def test_it_installs_and_makes_a_picture_in_a_window(
    release_zip: Path, tmp_path: Path, network: bool
) -> None:
    words = () if network else try_zip.cut_off()
    if words is None:
        pytest.skip("a process cannot be cut off from the network here")
    install = ("--command", "extension", "install-file", "-r", "user_default", "-e", str(release_zip))
    done = run(words, tmp_path, *install)
    assert done.returncode == 0, done.stdout + done.stderr
    # Started again, in a window: Blender then prefers the extension's packages to its own.
    script = str(ROOT / "tests" / "gui" / "release_flow.py")
    done = run(words, tmp_path, "--python", script, "--", str(release_zip), str(tmp_path))
    seen = tmp_path / "seen.json"
    assert seen.exists(), done.stdout + done.stderr
    found: dict[str, Any] = json.loads(seen.read_text())
    assert found["error"] == ""
    assert found["windows"] == 1
    assert not found["background"]
    assert {"numba", "llvmlite", "scipy", "OpenEXR", "png"} <= set(found["modules"])
    if not network:
        assert found["interfaces"] == ["lo"]
