"""The release's zip installs and makes a picture with its own packages, with a network and without one."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from .conftest import ROOT

sys.path.insert(0, str(ROOT / "tools"))

import build_extension
import fetch_wheels
import release
import try_zip

PYTHON = f"cp{sys.version_info.major}{sys.version_info.minor}"


@pytest.fixture(scope="module")
def release_zip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The zip for this Python, where its wheels were downloaded before."""
    here = release.MACHINES.get((release.platform.system(), release.platform.machine()))
    if here is None:
        pytest.skip("there is no zip for this machine")
    name = f"{here}-{PYTHON}"
    try:
        fetch_wheels.find_wheels(name)
    except (FileNotFoundError, ValueError):
        pytest.skip(f"the wheels are not here: tools/fetch_wheels.py {name} downloads them")
    return build_extension.build(tmp_path_factory.mktemp("release"), name)


def test_it_works_with_its_own_packages(release_zip: Path) -> None:
    found = try_zip.run(sys.executable, release_zip, quick=True)
    pins = fetch_wheels.read_pins(PYTHON)
    assert {name: found["modules"][name] for name in ("numba", "llvmlite", "scipy", "OpenEXR")} == {
        name: pins[name] for name in ("numba", "llvmlite", "scipy", "OpenEXR")
    }
    assert "png" in found["modules"]


def test_it_works_without_a_network(release_zip: Path) -> None:
    words = try_zip.cut_off()
    if words is None:
        pytest.skip("a process cannot be cut off from the network here")
    found = try_zip.run(sys.executable, release_zip, quick=True, words=words)
    assert found["interfaces"] == ["lo"]
    assert "numba" in found["modules"]


def test_a_package_that_the_zip_lacks_is_missed(release_zip: Path, tmp_path: Path) -> None:
    """Show that the trial does not fall back on the environment's packages."""
    listed = try_zip.wheel_modules(release_zip)
    assert set(listed) == {"Imath", "OpenEXR", "llvmlite", "numba", "png", "scipy"}
    with pytest.raises(try_zip.TrialError, match="is not the zip's"):
        try_zip.check_modules({"png": listed["png"]}, tmp_path)
