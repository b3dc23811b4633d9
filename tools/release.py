"""Make everything that a release is published with, out of the last commit and nothing else.

Versions are compared, the wheels' hashes and licences checked, a zip is built for each platform and Python
out of a clone of the repository and validated by Blender's own tool, those for this machine are installed and
tried, and checksums, bills of materials and the index of a repository are written beside them.
"""

from __future__ import annotations

import argparse
import ast
import datetime as dt
import json
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from pathlib import Path
from typing import NamedTuple

import bill_of_materials
import build_extension
import fetch_wheels
import third_party
import try_zip

ROOT = Path(__file__).resolve().parent.parent
SUMS = "SHA256SUMS"
INDEX = "index.json"

# The Blenders that have each Python; the first has the oldest numpy.
BLENDERS = {"cp311": ["4.5", "5.0"], "cp313": ["5.1", "5.2"]}
MACHINES = {
    ("Linux", "x86_64"): "linux-x64",
    ("Windows", "AMD64"): "windows-x64",
    ("Darwin", "arm64"): "macos-arm64",
}

PUBLISH = """\
{count} zips of {version} are in {output}. To publish them:

1. Tag the commit:         git tag -a v{version} {commit} -m "Version {version}" && git push origin v{version}
   .github/workflows/release.yml then makes the same files, attests where they come from, and drafts the
   GitHub release. By hand:
                           gh release create v{version} --draft --verify-tag --notes-file NOTES {output}/*
   where `{python} tools/release.py --notes` prints the notes.
2. extensions.blender.org: log in, "Upload Extension" the first time, "Upload New Version" later, and upload
   the zips one after the other: each names its platform and its Blender versions. The site reviews them.
3. A repository of one's own: put the zips and {index} into one folder of any web server, or leave them at the
   GitHub release. Users add the address of {index} (at GitHub under releases/latest/download/) in
   Preferences > Get Extensions > Repositories > Add Remote Repository.
"""


class ReleaseError(Exception):
    """The release cannot be made; the message says what is wrong and what to do."""


class Changes(NamedTuple):
    """The newest section of the changelog.

    Attributes
    ----------
    version : str
        Its version, or ``Unreleased``.
    date : str
        As it is written, or nothing.
    text : str
        What it says, without the heading.
    """

    version: str
    date: str
    text: str


def newest_changes(changelog: str) -> Changes:
    """Read the newest section of a changelog.

    Parameters
    ----------
    changelog : str
        Text as Keep a Changelog has it: ``## 0.1.0 - 2026-11-23`` or ``## Unreleased`` above each section.

    Returns
    -------
    Changes
        The first section that is there.

    Raises
    ------
    ReleaseError
        If there is none.
    """
    headings = list(re.finditer(r"(?m)^## \[?([^\]\s]+)\]?(?: - (.*))?$", changelog))
    if not headings:
        raise ReleaseError("CHANGELOG.md has no section; write what the release brings under its version.")
    first = headings[0]
    end = headings[1].start() if len(headings) > 1 else len(changelog)
    return Changes(first[1], (first[2] or "").strip(), changelog[first.end() : end].strip())


def check_versions(root: Path, *, allow_unreleased: bool, tag: str | None = None) -> tuple[str, Changes]:
    """Make sure that everything that names a version names the same.

    Parameters
    ----------
    root : Path
        The project's top folder.
    allow_unreleased : bool
        Be content with a section *Unreleased* in the changelog.
    tag : str or None
        A tag, for example ``v0.1.0``, that has to fit too.

    Returns
    -------
    str
        The version.
    Changes
        The changelog's newest section.

    Raises
    ------
    ReleaseError
        If they differ, or the changelog has no section with a date for the version.
    """

    def read(name: str) -> str:
        return (root / name).read_text(encoding="utf-8")

    version = str(tomllib.loads(read("blender_manifest.toml"))["version"])
    cited = re.search(r"(?m)^version: (\S+)$", read("CITATION.cff"))
    versions = {
        "pyproject.toml": tomllib.loads(read("pyproject.toml"))["project"]["version"],
        "CITATION.cff": cited[1] if cited else None,
        "potmesil_addon/__init__.py": _core_version(read("potmesil_addon/__init__.py")),
    }
    for name, other in versions.items():
        if other != version:
            raise ReleaseError(
                f"blender_manifest.toml is of version {version} and {name} of {other}; make them equal."
            )
    if tag is not None and tag != f"v{version}":
        raise ReleaseError(f"The tag is {tag} and the version {version}; tag the commit v{version}.")
    changes = newest_changes(read("CHANGELOG.md"))
    if not changes.text:
        raise ReleaseError(
            f"The section {changes.version} of CHANGELOG.md is empty; write what the release brings."
        )
    if changes.version == "Unreleased" and allow_unreleased:
        return version, changes
    if changes.version != version:
        raise ReleaseError(
            f'The newest section of CHANGELOG.md is "{changes.version}"; call it "{version} - {_today()}" to '
            "release, or give --allow-unreleased to try what a release would be."
        )
    try:
        dt.date.fromisoformat(changes.date)
    except ValueError as error:
        raise ReleaseError(
            f'The section {version} of CHANGELOG.md has no date; call it "{version} - {_today()}".'
        ) from error
    return version, changes


def _today() -> str:
    return dt.datetime.now(dt.UTC).date().isoformat()


def _core_version(source: str) -> str | None:
    for node in ast.parse(source).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__version__":
            return str(ast.literal_eval(node.value))
    return None


def git(root: Path, *words: str) -> str:
    """Run git in a folder and return what it prints.

    Raises
    ------
    ReleaseError
        If it fails.
    """
    try:
        done = subprocess.run(["git", "-C", str(root), *words], capture_output=True, text=True, check=False)
    except FileNotFoundError as error:
        raise ReleaseError("git is not installed; a release is made of a commit.") from error
    if done.returncode != 0:
        raise ReleaseError(f"git {words[0]}: {done.stderr.strip()}")
    return done.stdout.strip()


def check_clean(root: Path) -> str:
    """Make sure that the work tree is what its last commit is; return the commit.

    Raises
    ------
    ReleaseError
        If something is changed or not committed.
    """
    if changed := git(root, "status", "--porcelain").splitlines():
        names = ", ".join(line[2:].strip() for line in changed[:3]) + (
            " and more" if len(changed) > 3 else ""
        )
        raise ReleaseError(
            f"The work tree has changes that are in no commit ({names}); commit or remove them."
        )
    return git(root, "rev-parse", "HEAD")


def clone(root: Path, commit: str, folder: Path) -> None:
    """Make a clone of one commit: nothing that only lies about in the work tree is in it."""
    git(root, "clone", "--quiet", "--no-checkout", str(root), str(folder))
    git(folder, "checkout", "--quiet", "--detach", commit)


def numpy_of(python: str) -> str:
    """Return the version of the oldest numpy that a supported Blender with this Python has."""
    text = (ROOT / "requirements" / f"blender-{BLENDERS[python][0]}.txt").read_text(encoding="utf-8")
    (version,) = re.findall(r"(?m)^numpy==(\S+)$", text)
    return str(version)


def try_on_this_machine(zip_path: Path, release: str) -> list[str]:
    """Install a zip under each Blender that is here for it.

    Parameters
    ----------
    zip_path : Path
        The zip.
    release : str
        Its platform and Python.

    Returns
    -------
    list of str
        What was done, a line each.

    Raises
    ------
    ReleaseError
        If the zip does not work.
    """
    here = MACHINES.get((platform.system(), platform.machine()))
    wanted, python = fetch_wheels.split_release(release)
    if wanted != here:
        return [f"{release}: not tried, which needs another machine"]
    said: list[str] = []
    for version in BLENDERS[python]:
        folder = ROOT / ".venv" / f"bpy-{version}"
        command = folder / ("Scripts/python.exe" if here == "windows-x64" else "bin/python")
        if not command.exists():
            said.append(f"{release}: not tried under Blender {version}, whose environment is not here")
            continue
        try:
            # The newest compiles all that a picture needs.
            found = try_zip.run(command, zip_path, quick=version != BLENDERS[python][-1])
        except try_zip.TrialError as error:
            raise ReleaseError(str(error)) from error
        said.append(f"{release}: installs and makes a picture under Blender {found['blender']}")
    return said


def make_release(root: Path, commit: str, releases: list[str], made: Path, *, trial: bool) -> list[Path]:
    """Build, validate and try the zips, and write what goes with them.

    Parameters
    ----------
    root : Path
        A clone of the commit.
    commit : str
        The commit.
    releases : list of str
        Platforms and Pythons.
    made : Path
        An empty folder that everything goes to.
    trial : bool
        Install the zips that can be installed on this machine.

    Returns
    -------
    list of Path
        The zips.

    Raises
    ------
    ReleaseError
        If any zip is not fit to be published.
    """
    moment = build_extension.moment_of(root)
    zips: list[Path] = []
    for release in releases:
        _, python = fetch_wheels.split_release(release)
        try:
            wheels = fetch_wheels.fetch(release)
            zip_path = build_extension.build(made, release, root)
        except subprocess.CalledProcessError as error:
            raise ReleaseError(
                f"pip could not download the wheels of {release}; see what it said above."
            ) from error
        except (build_extension.BuildError, ValueError) as error:
            raise ReleaseError(str(error)) from error
        with zipfile.ZipFile(zip_path) as archive:
            manifest = tomllib.loads(archive.read(build_extension.MANIFEST).decode("utf-8"))
        bill = bill_of_materials.bill_of_materials(
            zip_path, manifest, [third_party.read_wheel(wheel) for wheel in wheels], numpy_of(python), moment
        )
        bill["metadata"]["component"]["properties"] = [{"name": "potmesil:commit", "value": commit}]
        zip_path.with_suffix(".cdx.json").write_text(json.dumps(bill, indent=2) + "\n", encoding="utf-8")
        print(f"{zip_path.name}: built and validated, {zip_path.stat().st_size / 1e6:.0f} MB", flush=True)
        zips.append(zip_path)
    if trial:
        for release, zip_path in zip(releases, zips, strict=True):
            print("\n".join(try_on_this_machine(zip_path, release)), flush=True)
    try:
        build_extension.blender_ext("server-generate", f"--repo-dir={made}")
    except build_extension.BuildError as error:
        raise ReleaseError(str(error)) from error
    files = sorted(path for path in made.iterdir() if path.is_file())
    lines = [f"{fetch_wheels.hash_of(path)}  {path.name}\n" for path in files]
    (made / SUMS).write_text("".join(lines), encoding="utf-8")
    return zips


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=ROOT / "dist", help="folder that the files go to")
    parser.add_argument(
        "--releases",
        nargs="+",
        choices=fetch_wheels.RELEASES,
        default=fetch_wheels.RELEASES,
        metavar="PLATFORM-PYTHON",
        help=f"which zips: {', '.join(fetch_wheels.RELEASES)}; all by default",
    )
    parser.add_argument(
        "--allow-unreleased", action="store_true", help="take the changelog's section Unreleased"
    )
    parser.add_argument("--tag", help="the tag that the release is made of, which has to fit the version")
    parser.add_argument("--no-trial", action="store_true", help="build the zips without installing any")
    parser.add_argument(
        "--notes", action="store_true", help="print the changelog's newest section, and do no more"
    )
    options = parser.parse_args()
    try:
        version, changes = check_versions(
            ROOT, allow_unreleased=options.allow_unreleased or options.notes, tag=options.tag
        )
        if options.notes:
            print(changes.text)
            return 0
        commit = check_clean(ROOT)
        with tempfile.TemporaryDirectory(prefix="potmesil_release_") as folder:
            source, made = Path(folder) / "source", Path(folder) / "made"
            made.mkdir()
            clone(ROOT, commit, source)
            zips = make_release(source, commit, options.releases, made, trial=not options.no_trial)
            # Only now: a folder holds a whole release, or what it held before.
            options.output.mkdir(parents=True, exist_ok=True)
            for path in sorted(made.iterdir()):
                shutil.copyfile(path, options.output / path.name)
    except ReleaseError as error:
        print(f"release: {error}", file=sys.stderr)
        return 1
    python, output = Path(sys.executable), options.output.absolute()
    python = python.relative_to(ROOT) if python.is_relative_to(ROOT) else python
    output = output.relative_to(ROOT) if output.is_relative_to(ROOT) else output
    print()
    print(
        PUBLISH.format(
            count=len(zips),
            version=version,
            output=output,
            commit=commit[:12],
            index=INDEX,
            python=python,
        )
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
