"""Download the wheels that ride in a release zip, at the versions pinned in ``requirements/wheels.txt``.

A release is named by platform and Python, for example ``linux-x64-cp311``. The wheels go to
``build/wheels/RELEASE/``, which is never committed. ``requirements/wheels.sha256`` has the hash of every
wheel; one with another hash is refused.
"""

from __future__ import annotations

import argparse
import hashlib
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PINS = ROOT / "requirements" / "wheels.txt"
HASHES = ROOT / "requirements" / "wheels.sha256"
FOLDER = ROOT / "build" / "wheels"

# Blender runs on glibc 2.28 and later. pip compares these tags letter by letter, so each one is named:
# a wheel tagged manylinux_2_27 would otherwise be passed over for an older release.
LINUX_TAGS = [f"manylinux_2_{minor}_x86_64" for minor in range(28, 4, -1)]
LINUX_TAGS += ["manylinux2014_x86_64", "manylinux2010_x86_64", "manylinux1_x86_64"]

PLATFORM_TAGS = {
    "linux-x64": LINUX_TAGS,
    "windows-x64": ["win_amd64"],
    # pip adds the older macOS versions by itself.
    "macos-arm64": ["macosx_12_0_arm64"],
}
PYTHON_VERSIONS = {"cp311": "3.11", "cp313": "3.13"}
RELEASES = [f"{platform}-{python}" for platform in PLATFORM_TAGS for python in PYTHON_VERSIONS]

# For the tests alone, in the Blender of a Linux distribution, which has that distribution's Python.
TRIAL = "linux-x64-cp314"
TRIAL_PYTHON = {"cp314": "3.14"}

PIN = re.compile(
    r"(?P<name>[\w.-]+)==(?P<version>[\w.]+)(?:\s*;\s*python_version\s*==\s*\"(?P<python>[\d.]+)\")?"
)


def split_release(release: str) -> tuple[str, str]:
    """Split ``linux-x64-cp311`` into ``linux-x64`` and ``cp311``.

    Raises
    ------
    ValueError
        If the name is neither one of `RELEASES` nor `TRIAL`.
    """
    if release not in [*RELEASES, TRIAL]:
        raise ValueError(f"{release!r} is not one of {', '.join(RELEASES)}")
    platform, _, python = release.rpartition("-")
    return platform, python


def read_pins(python: str, path: Path = PINS) -> dict[str, str]:
    """Read the pinned versions for one Python.

    Parameters
    ----------
    python : str
        ABI tag, for example ``cp311``.
    path : Path
        The requirement file.

    Returns
    -------
    dict of str to str
        Version by distribution name, as the file spells it.

    Raises
    ------
    ValueError
        If a line is not an exact pin, or pins a distribution twice for this Python.
    """
    # A Python that no Blender of Blender's own has yet is tried with the newest one's versions.
    version = PYTHON_VERSIONS.get(python, max(PYTHON_VERSIONS.values()))
    pins: dict[str, str] = {}
    for raw in path.read_text(encoding="utf-8").splitlines():
        line = raw.partition("#")[0].strip()
        if not line:
            continue
        match = PIN.fullmatch(line)
        if match is None:
            raise ValueError(f'{path.name}: cannot read "{line}", expected name==version')
        if match["python"] not in (None, version):
            continue
        if match["name"] in pins:
            raise ValueError(f"{path.name}: {match['name']} is pinned twice for {python}")
        pins[match["name"]] = match["version"]
    return pins


def read_hashes(path: Path = HASHES) -> dict[str, str]:
    """Read the wheels' SHA-256 hashes.

    Returns
    -------
    dict of str to str
        Hash, in hexadecimal digits, by file name.
    """
    lines = path.read_text(encoding="utf-8").splitlines()
    return {name: digest for digest, name in (line.split() for line in lines)}


def hash_of(path: Path) -> str:
    """Return a file's SHA-256 hash, in hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def check_hashes(wheels: list[Path], hashes: dict[str, str]) -> None:
    """Make sure that wheels are those that were pinned.

    Raises
    ------
    ValueError
        If a wheel's hash is another, or none is known.
    """
    for wheel in wheels:
        if wheel.name not in hashes:
            raise ValueError(f"{HASHES.name} has no hash of {wheel.name}; see tools/fetch_wheels.py --record")
        if hash_of(wheel) != hashes[wheel.name]:
            raise ValueError(f"{wheel} is not the wheel whose hash is in {HASHES.name}; remove it")


def record_hashes(wheels: list[Path], path: Path = HASHES) -> None:
    """Write the wheels' hashes, as ``sha256sum --check`` reads them."""
    names = {wheel.name: wheel for wheel in wheels}
    lines = [f"{hash_of(wheel)}  {name}\n" for name, wheel in sorted(names.items())]
    path.write_text("".join(lines), encoding="utf-8")


def find_wheels(release: str, folder: Path = FOLDER) -> list[Path]:
    """List a release's downloaded wheels.

    Returns
    -------
    list of Path
        One wheel for each pin, sorted by name.

    Raises
    ------
    FileNotFoundError
        If a pinned wheel is missing.
    ValueError
        If the folder holds anything else.
    """
    _, python = split_release(release)
    # Wheel names spell a distribution in lower case, or as its project does: compare without case.
    wanted = {(name.lower().replace("-", "_"), version) for name, version in read_pins(python).items()}
    wheels: dict[tuple[str, str], Path] = {}
    for path in sorted((folder / release).glob("*")):
        name, version = path.name.split("-")[:2]
        wheels[name.lower(), version] = path
    if extra := wheels.keys() - wanted:
        raise ValueError(f"{folder / release} holds wheels that are not pinned: {sorted(extra)}")
    if missing := wanted - wheels.keys():
        raise FileNotFoundError(
            f"{folder / release} has no wheel of {sorted(missing)}; run tools/fetch_wheels.py"
        )
    return sorted(wheels.values())


def fetch(release: str, folder: Path = FOLDER) -> list[Path]:
    """Download a release's wheels; do nothing where they are there already.

    Raises
    ------
    subprocess.CalledProcessError
        If pip finds no wheel of a pinned version for the release.
    """
    try:
        return find_wheels(release, folder)
    except (FileNotFoundError, ValueError):
        pass
    platform, python = split_release(release)
    target = folder / release
    target.mkdir(parents=True, exist_ok=True)
    versions = PYTHON_VERSIONS | TRIAL_PYTHON
    for stale in target.iterdir():
        stale.unlink()
    command = [sys.executable, "-m", "pip", "download", "-qq", "--disable-pip-version-check"]
    command += ["--no-deps", "--only-binary=:all:", "--implementation", "cp"]
    command += [
        "--python-version",
        versions[python],
        "--abi",
        python,
        "--abi",
        "abi3",
        "--abi",
        "none",
    ]
    for tag in PLATFORM_TAGS[platform]:
        command += ["--platform", tag]
    # Not -r: pip would read the file's markers for the Python it runs on, not for the release's.
    pins = [f"{name}=={version}" for name, version in read_pins(python).items()]
    subprocess.run([*command, "--dest", str(target), *pins], check=True)
    return find_wheels(release, folder)


def manifest_lines(release: str, wheels: list[Path]) -> str:
    """Write the ``platforms`` and ``wheels`` entries of a release's manifest, as TOML."""
    platform, _ = split_release(release)
    entries = "".join(f'  "./wheels/{wheel.name}",\n' for wheel in wheels)
    return f'platforms = ["{platform}"]\nwheels = [\n{entries}]\n'


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    known = [*RELEASES, TRIAL]
    parser.add_argument("releases", nargs="+", choices=known, metavar="RELEASE", help=", ".join(known))
    parser.add_argument(
        "--record",
        action="store_true",
        help=f"write {HASHES.name} anew: after a pin has changed, for all releases",
    )
    parser.add_argument(
        "--print-manifest", action="store_true", help="print the manifest's entries instead of the sizes"
    )
    arguments = parser.parse_args()
    fetched: list[Path] = []
    for release in arguments.releases:
        try:
            wheels = fetch(release)
            if not arguments.record:
                check_hashes(wheels, read_hashes())
        except subprocess.CalledProcessError:
            print(f"pip could not download the wheels of {release}.", file=sys.stderr)
            return 1
        except ValueError as error:
            print(f"fetch_wheels: {error}", file=sys.stderr)
            return 1
        fetched += wheels
        if arguments.print_manifest:
            print(manifest_lines(release, wheels), end="")
        else:
            size = sum(wheel.stat().st_size for wheel in wheels)
            print(f"{release}: {len(wheels)} wheels, {size / 1e6:.1f} MB")
    if arguments.record:
        record_hashes(fetched)
    return 0


if __name__ == "__main__":
    sys.exit(main())
