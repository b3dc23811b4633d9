"""Build and validate the extension's zip with Blender's own tool, which comes inside the bpy wheel.

Run it with the Python of an environment that holds bpy; bpy itself is not imported. Without wheels the zip
is for development: it works wherever numpy, scipy and OpenEXR can be imported already. What is built twice of
one commit has the same bytes.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
import zipfile
from pathlib import Path

import fetch_wheels
import third_party

ROOT = Path(__file__).resolve().parent.parent
MANIFEST = "blender_manifest.toml"

# What a zip may hold at its top; anything else means that the manifest's exclusions have a hole.
SHIPPED = {
    MANIFEST,
    "LICENSE",
    "README.md",
    third_party.FILE,
    "__init__.py",
    "operators",
    "potmesil_addon",
    "presets",
    "ui",
    "wheels",
}

# Blender changed from Python 3.11 to 3.13 with this version, so a release's wheels fit one side of it.
FIRST_CP313 = "5.1.0"

# The first moment that a zip can name, for what is built outside a git work tree.
EARLIEST = 315532800


class BuildError(Exception):
    """The zip could not be built as it should be."""


def blender_scripts() -> Path:
    """Find the scripts folder of the installed bpy wheel without importing it.

    Raises
    ------
    BuildError
        If this Python has no bpy.
    """
    spec = importlib.util.find_spec("bpy")
    locations = spec.submodule_search_locations if spec is not None else None
    for location in locations or ():
        for scripts in sorted(Path(location).glob("[0-9]*/scripts")):
            return scripts
    raise BuildError(f"{sys.executable} has no bpy")


def blender_ext(command: str, *arguments: str) -> None:
    """Run one command of Blender's extension tool, as ``blender --command extension`` runs it.

    Raises
    ------
    BuildError
        If the tool does not succeed; what it printed is the message.
    """
    scripts = blender_scripts()
    tool = scripts / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"
    # Blender passes this very file; without it the tool accepts any tag.
    tags = scripts / "modules" / "_bpy_internal" / "extensions" / "tags.py"
    for path in (tool, tags):
        if not path.is_file():
            raise BuildError(f"this bpy has no {path.relative_to(scripts)}")
    words = [] if command == "server-generate" else [f"--valid-tags={tags}"]
    result = subprocess.run(
        [sys.executable, str(tool), command, *words, *arguments],
        capture_output=True,
        text=True,
        check=False,
    )
    if result.returncode != 0:
        raise BuildError(f"blender_ext {command}: {(result.stderr + result.stdout).strip()}")


def list_sources(root: Path) -> list[Path]:
    """List the project's files relative to its root, leaving out whatever git ignores.

    Parameters
    ----------
    root : Path
        The project's top folder.

    Returns
    -------
    list of Path
        Tracked files and new ones; outside a git work tree, all but hidden and built files.
    """
    git = ["git", "-C", str(root)]
    try:
        prefix = subprocess.run(
            [*git, "rev-parse", "--show-prefix"], capture_output=True, text=True, check=False
        )
    except FileNotFoundError:
        prefix = None
    # A prefix means that the project lies inside some other work tree, whose list would not be ours.
    if prefix is not None and prefix.returncode == 0 and not prefix.stdout.strip():
        listed = subprocess.run(
            [*git, "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        paths = [Path(name) for name in listed.split("\0") if name]
    else:
        paths = [
            path
            for path in (found.relative_to(root) for found in root.rglob("*"))
            if path.parts[0] not in {"build", "dist"}
            and not any(part.startswith(".") or part == "__pycache__" for part in path.parts)
        ]
    return sorted(path for path in paths if (root / path).is_file())


def release_manifest(text: str, release: str, wheels: list[Path]) -> str:
    """Turn the development manifest into a release's.

    Parameters
    ----------
    text : str
        The manifest in the repository, which names no wheels.
    release : str
        Platform and Python, for example ``linux-x64-cp311``.
    wheels : list of Path
        The wheels that ride in the zip.

    Returns
    -------
    str
        The manifest with wheels, platform, and the Blender versions that run this Python.
    """
    _, python = fetch_wheels.split_release(release)
    key = "blender_version_max" if python == "cp311" else "blender_version_min"
    text, replaced = re.subn(rf'(?m)^{key} = ".*"$', f'{key} = "{FIRST_CP313}"', text)
    if replaced != 1:
        raise BuildError(f"{MANIFEST} has no {key}")
    # Keys of the top level have to stand before the first table.
    head, bracket, tables = text.partition("\n[")
    return f"{head}\n{fetch_wheels.manifest_lines(release, wheels)}{bracket}{tables}"


def moment_of(root: Path) -> int:
    """Return the time that a zip's files are given, in seconds since 1970.

    Parameters
    ----------
    root : Path
        The project's top folder.

    Returns
    -------
    int
        ``SOURCE_DATE_EPOCH`` where the environment has it, else the time of the last commit.
    """
    chosen = os.environ.get("SOURCE_DATE_EPOCH", "")
    if not chosen:
        done = subprocess.run(
            ["git", "-C", str(root), "log", "-1", "--format=%ct"], capture_output=True, text=True, check=False
        )
        chosen = done.stdout.strip()
    return max(int(chosen), EARLIEST) if chosen.isdecimal() else EARLIEST


def make_reproducible(zip_path: Path, moment: int) -> None:
    """Write a zip again with sorted names, one time for all, and one mode.

    Parameters
    ----------
    zip_path : Path
        The zip, which is replaced.
    moment : int
        The time, in seconds since 1970.
    """
    made = zip_path.with_suffix(".part")
    date = time.gmtime(moment)[:6]
    with zipfile.ZipFile(zip_path) as old, zipfile.ZipFile(made, "w") as new:
        for name in sorted(old.namelist()):
            entry = zipfile.ZipInfo(name, date)
            entry.compress_type = old.getinfo(name).compress_type
            # As on Linux, wherever it is built: a file that all may read.
            entry.create_system, entry.external_attr = 3, 0o100644 << 16
            new.writestr(entry, old.read(name), compresslevel=9)
    made.replace(zip_path)


def check_contents(zip_path: Path, wheels: list[Path]) -> None:
    """Make sure that a zip holds the extension, its wheels, and nothing else.

    Raises
    ------
    BuildError
        If something is missing or something local rides along.
    """
    with zipfile.ZipFile(zip_path) as archive:
        names = [Path(name) for name in archive.namelist() if not name.endswith("/")]
    strangers = [
        str(name)
        for name in names
        if name.parts[0] not in SHIPPED
        or "__pycache__" in name.parts
        or name.suffix in {".pyc", ".blend", ".zip"}
    ]
    if strangers:
        raise BuildError(f"{zip_path.name} holds files that do not belong in it: {', '.join(strangers)}")
    needed = {MANIFEST, "LICENSE", "__init__.py", "potmesil_addon/__init__.py"}
    needed |= {f"wheels/{wheel.name}" for wheel in wheels}
    if wheels:
        needed.add(third_party.FILE)
    if missing := needed - {name.as_posix() for name in names}:
        raise BuildError(f"{zip_path.name} lacks {', '.join(sorted(missing))}")
    shipped_wheels = {name.name for name in names if name.suffix == ".whl"}
    if shipped_wheels != {wheel.name for wheel in wheels}:
        raise BuildError(f"{zip_path.name} holds the wheels {sorted(shipped_wheels)}")


def build(
    output: Path, release: str | None, root: Path = ROOT, wheels_folder: Path = fetch_wheels.FOLDER
) -> Path:
    """Build one zip and validate it.

    Parameters
    ----------
    output : Path
        Folder that the zip goes to.
    release : str or None
        Platform and Python whose wheels ride along, for example ``linux-x64-cp311``; None for a zip without.
    root : Path
        The project's top folder.
    wheels_folder : Path
        Folder of the downloaded wheels.

    Returns
    -------
    Path
        The zip.

    Raises
    ------
    BuildError
        If Blender's tool refuses the extension, the zip holds the wrong files, or a wheel is not the pinned
        one or not under a licence that is known.
    """
    text = (root / MANIFEST).read_text(encoding="utf-8")
    manifest = tomllib.loads(text)
    name = f"{manifest['id']}-{manifest['version']}"
    wheels: list[Path] = []
    notices = ""
    if release is not None:
        try:
            wheels = fetch_wheels.find_wheels(release, wheels_folder)
            fetch_wheels.check_hashes(wheels, fetch_wheels.read_hashes())
            notices = third_party.notices([third_party.read_wheel(wheel) for wheel in wheels])
        except (FileNotFoundError, ValueError, third_party.LicenseError) as error:
            raise BuildError(str(error)) from error
        text = release_manifest(text, release, wheels)
        platform, python = fetch_wheels.split_release(release)
        name += f"-{platform.replace('-', '_')}-{python}"

    output.mkdir(parents=True, exist_ok=True)
    zip_path = output / f"{name}.zip"
    # A copy, so that nothing that only lies about in this work tree rides in the zip.
    with tempfile.TemporaryDirectory() as folder:
        stage = Path(folder) / manifest["id"]
        for source in list_sources(root):
            (stage / source).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(root / source, stage / source)
        for wheel in wheels:
            (stage / "wheels").mkdir(exist_ok=True)
            shutil.copyfile(wheel, stage / "wheels" / wheel.name)
        if notices:
            (stage / third_party.FILE).write_text(notices, encoding="utf-8", newline="\n")
        (stage / MANIFEST).write_text(text, encoding="utf-8")
        blender_ext("build", f"--source-dir={stage}", f"--output-filepath={zip_path}")
    make_reproducible(zip_path, moment_of(root))
    try:
        blender_ext("validate", str(zip_path))
        check_contents(zip_path, wheels)
    except BuildError:
        # A zip that is not fit to install must not be found in the output folder.
        zip_path.unlink()
        raise
    return zip_path


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=ROOT / "dist", help="folder that the zip goes to")
    parser.add_argument(
        "--wheels",
        choices=["none", *fetch_wheels.RELEASES, fetch_wheels.TRIAL],
        default="none",
        metavar="none|PLATFORM-PYTHON",
        help=f"wheels that ride along: none, {', '.join(fetch_wheels.RELEASES)}",
    )
    arguments = parser.parse_args()
    try:
        zip_path = build(arguments.output, None if arguments.wheels == "none" else arguments.wheels)
    except BuildError as error:
        print(f"build_extension: {error}", file=sys.stderr)
        return 1
    print(zip_path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
