"""Install a zip into a profile that is thrown away, and make a picture with the packages that ride in it.

Run it with the Python of an environment that holds bpy, or inside a Blender:

    python tools/try_zip.py ZIP
    blender -b --python-exit-code 1 --python tools/try_zip.py -- ZIP

What the environment has of the packages itself is hidden: each has to come out of the zip. One line of JSON
says what was found.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import re
import site
import socket
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from importlib import metadata
from pathlib import Path
from typing import Any

REPOSITORY = "user_default"
SIZE = 24
LENS = ["--fstop", "1", "--focus-distance", "8", "--focal-length", "50", "--sensor-width", "6"]

# What compiles least: kernels are compiled anew in every profile.
QUICK = ["--psf", "disc", "--visibility", "none", "--no-blocks", "--no-motion", "--backend", "numpy"]


class TrialError(Exception):
    """The zip does not do what it should."""


def hide_environment(folder: Path) -> None:
    """Leave bpy and what bpy itself needs of the environment, as a Blender has them.

    Parameters
    ----------
    folder : Path
        An empty folder, which takes the place of the environment's on `sys.path`.
    """
    wanted, seen = ["bpy"], set()
    while wanted:
        name = wanted.pop()
        if name in seen:
            continue
        seen.add(name)
        try:
            distribution = metadata.distribution(name)
        except metadata.PackageNotFoundError:
            # Needed by another version of Python only.
            continue
        for file in distribution.files or ():
            top = file.parts[0]
            if top not in ("..", "__pycache__") and not (folder / top).exists():
                (folder / top).symlink_to(Path(str(distribution.locate_file(top))))
        requirements = [line for line in distribution.requires or () if "extra ==" not in line]
        wanted += [match[0] for line in requirements if (match := re.match(r"[\w.-]+", line))]
    own = {Path(place).resolve() for place in site.getsitepackages()}
    sys.path[:] = [place for place in sys.path if Path(place).resolve() not in own] + [str(folder)]


def wheel_modules(archive: Path) -> dict[str, str]:
    """List what the wheels of a zip bring.

    Parameters
    ----------
    archive : Path
        The extension's zip.

    Returns
    -------
    dict of str to str
        Wheel by the name of a module or package at its top.
    """
    found: dict[str, str] = {}
    with zipfile.ZipFile(archive) as outer:
        for name in sorted(outer.namelist()):
            if not name.endswith(".whl"):
                continue
            with outer.open(name) as file, zipfile.ZipFile(file) as wheel:
                for member in wheel.namelist():
                    top, _, rest = member.partition("/")
                    # A package, or a module of one file: png.py, OpenEXR.cpython-313-x86_64-linux-gnu.so.
                    if rest == "__init__.py" or (not rest and re.search(r"\.(py|so|pyd)$", top)):
                        found[top.partition(".")[0]] = Path(name).name
                    elif re.fullmatch(r"[^/]+\.data/(platlib|purelib)/[^/]+\.(py|so|pyd)", member):
                        found[Path(member).name.partition(".")[0]] = Path(name).name
    return found


def check_modules(modules: dict[str, str], folder: Path) -> dict[str, str]:
    """Import the modules and make sure that they came out of the zip.

    Returns
    -------
    dict of str to str
        Version, or nothing where a module has none, by name.

    Raises
    ------
    TrialError
        If a module lies elsewhere than in the folder.
    """
    versions: dict[str, str] = {}
    for name, wheel in modules.items():
        module = importlib.import_module(name)
        place = Path(module.__file__ or "").resolve()
        if not place.is_relative_to(folder.resolve()):
            raise TrialError(f"{name} of {wheel} is not the zip's: {place}")
        versions[name] = str(getattr(module, "__version__", ""))
    return versions


def write_samples(path: Path) -> None:
    """Write a samples file as any program may: two planes, a bright point, a depth for each pixel."""
    numpy = importlib.import_module("numpy")
    exr = importlib.import_module("OpenEXR")
    rows, columns = numpy.mgrid[:SIZE, :SIZE]
    depth = numpy.where(columns < SIZE // 2, 2.0, 8.0).astype(numpy.float32)
    colour = ((rows + columns) % 5 * 0.1).astype(numpy.float32)
    colour[SIZE // 2, SIZE // 4] = 20.0
    channels = dict.fromkeys("RGB", colour) | {"A": numpy.ones_like(colour), "Z": depth}
    header = {"compression": exr.ZIP_COMPRESSION, "type": exr.scanlineimage}
    exr.File(header, channels).write(str(path))


def read_colour(path: Path) -> Any:
    """Read a picture as (rows, columns, 3), however OpenEXR groups its channels."""
    numpy = importlib.import_module("numpy")
    exr = importlib.import_module("OpenEXR")
    channels = exr.File(str(path), separate_channels=True).channels()
    return numpy.stack([channels[name].pixels for name in "RGB"], axis=-1)


def check_picture(path: Path, samples: Path) -> None:
    """Make sure that a picture is there, whole and out of focus.

    Raises
    ------
    TrialError
        If it is not.
    """
    numpy = importlib.import_module("numpy")
    if not path.is_file():
        raise TrialError(f"process wrote no {path.name}")
    picture, before = read_colour(path), read_colour(samples)
    if picture.shape != before.shape or not numpy.isfinite(picture).all():
        raise TrialError(f"process wrote a broken picture of {picture.shape}")
    if not 0.0 < picture.max() < 0.5 * before.max():
        raise TrialError("process left the bright point as it was")


def try_zip(archive: Path, folder: Path, *, quick: bool = False) -> dict[str, Any]:
    """Install and enable the extension where it is not yet, and process.

    Parameters
    ----------
    archive : Path
        The extension's zip.
    folder : Path
        The profile's folder, which ``BLENDER_USER_RESOURCES`` names.
    quick : bool
        Compile few kernels.

    Returns
    -------
    dict
        Blender's and Python's version, versions by module, and the network's interfaces.

    Raises
    ------
    TrialError
        If something fails.
    """
    bpy = importlib.import_module("bpy")
    with zipfile.ZipFile(archive) as opened:
        manifest = tomllib.loads(opened.read("blender_manifest.toml").decode("utf-8"))
    modules = wheel_modules(archive)
    package = f"bl_ext.{REPOSITORY}.{manifest['id']}"
    if package not in bpy.context.preferences.addons:
        bpy.ops.extensions.package_install_files(
            filepath=str(archive), repo=REPOSITORY, enable_on_install=True
        )
    if package not in bpy.context.preferences.addons or not hasattr(bpy.types, "POTMESIL_OT_render"):
        raise TrialError(f"{archive.name} is installed and not enabled")
    versions = check_modules(modules, folder)
    core = importlib.import_module(f"{package}.potmesil_addon")
    if core.__version__ != manifest["version"]:
        raise TrialError(f"the installed core is {core.__version__}, the manifest's {manifest['version']}")
    samples, picture = folder / "samples.exr", folder / "picture.exr"
    write_samples(samples)
    command = importlib.import_module(f"{package}.operators.command").main
    process = ["process", str(samples), "-o", str(picture), *LENS, *(QUICK if quick else [])]
    for words in (["info", str(samples)], process):
        if status := command(words):
            raise TrialError(f"{words[0]} ended with {status}")
    check_picture(picture, samples)
    numba = importlib.import_module("numba")
    if numba.njit(lambda number: number + 1)(1) != 2:
        raise TrialError("numba compiles wrongly")
    return {
        "blender": bpy.app.version_string,
        "python": sys.version.partition(" ")[0],
        "modules": versions,
        "interfaces": [name for _, name in socket.if_nameindex()],
    }


def run(
    python: Path | str, archive: Path, *, quick: bool = False, words: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Try a zip in a process of its own.

    Parameters
    ----------
    python : Path or str
        Python of an environment that holds bpy.
    archive : Path
        The extension's zip.
    quick : bool
        Compile few kernels.
    words : tuple of str
        A command to run it under, for example one that takes the network away.

    Returns
    -------
    dict
        What `try_zip` found.

    Raises
    ------
    TrialError
        If something fails; what the process printed is the message.
    """
    done = subprocess.run(
        [*words, str(python), str(Path(__file__).resolve()), str(archive), *(["--quick"] if quick else [])],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise TrialError(f"{archive.name} does not work: {(done.stdout + done.stderr).strip()}")
    return found_in(done.stdout)


def cut_off() -> tuple[str, ...] | None:
    """Return the command that runs another one without a network, or None where there is none."""
    # Root does without a namespace of users, in which it could do less.
    for words in (("unshare", "--net"), ("unshare", "--net", "--map-root-user")):
        try:
            subprocess.run([*words, "true"], capture_output=True, check=True)
        except (OSError, subprocess.CalledProcessError):
            continue
        return words
    return None


def found_in(printed: str) -> dict[str, Any]:
    """Read what a process of this program found from what it printed."""
    for line in reversed(printed.splitlines()):
        if line.startswith("{"):
            found: dict[str, Any] = json.loads(line)
            return found
    raise TrialError(f"nothing was found in: {printed.strip()}")


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("zip", type=Path, metavar="ZIP", help="the extension's zip")
    parser.add_argument("--quick", action="store_true", help="compile few kernels")
    words = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    options = parser.parse_args(words)
    with tempfile.TemporaryDirectory(prefix="potmesil_trial_", ignore_cleanup_errors=True) as made:
        folder = Path(made)
        if "bpy" in sys.modules:
            # Inside Blender the profile is made already.
            if "BLENDER_USER_RESOURCES" not in os.environ:
                print("try_zip: set BLENDER_USER_RESOURCES to an empty folder", file=sys.stderr)
                return 2
            folder = Path(os.environ["BLENDER_USER_RESOURCES"])
        else:
            os.environ["BLENDER_USER_RESOURCES"] = str(folder)
            (folder / "blender").mkdir()
            hide_environment(folder / "blender")
        try:
            found = try_zip(options.zip.resolve(), folder, quick=options.quick)
        except TrialError as error:
            print(f"try_zip: {error}", file=sys.stderr)
            return 1
        print(json.dumps(found), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
