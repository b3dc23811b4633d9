"""Hold what rides in a release zip to the licences that are known of it, and gather their texts.

``requirements/licenses.toml`` says which licences are compatible with the extension's own, and which ones
each wheel and what is compiled into it are under.
"""

from __future__ import annotations

import fnmatch
import re
import tomllib
import zipfile
from dataclasses import dataclass
from email.message import Message
from email.parser import HeaderParser
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).resolve().parent.parent
KNOWN = ROOT / "requirements" / "licenses.toml"
FILE = "THIRD_PARTY_LICENSES.txt"

# Names of a licence's text, in dist-info or beside the code that it is for.
_TEXT = re.compile(r"(licen[cs]es?|copying|notice)([._-].*)?", re.IGNORECASE)
_LIBRARY = re.compile(r"(\.so(\.\d+)*|\.dylib|\.dll)$")
_RULE = "=" * 100


class LicenseError(Exception):
    """Something would ride in the zip that may not, or that nothing is known about."""


@dataclass(frozen=True)
class Part:
    """What else is compiled into a wheel, or lies in it.

    Attributes
    ----------
    name : str
        As its makers spell it.
    license : str
        SPDX expression.
    text : str
        The licence's text, where the wheel itself lacks it.
    """

    name: str
    license: str
    text: str = ""


@dataclass(frozen=True)
class Wheel:
    """One bundled distribution.

    Attributes
    ----------
    path : Path
        The wheel.
    name, version : str
        As its metadata has them.
    license : str
        SPDX expression for its own files.
    parts : tuple of Part
        What else rides in this very wheel.
    texts : dict of str to str
        The licences' texts in the wheel, by file name.
    requires : frozenset of str
        Distributions, in lower case, that it cannot work without.
    """

    path: Path
    name: str
    version: str
    license: str
    parts: tuple[Part, ...]
    texts: dict[str, str]
    requires: frozenset[str]

    @property
    def expression(self) -> str:
        """SPDX expression for the whole wheel."""
        return " AND ".join(dict.fromkeys([self.license, *(part.license for part in self.parts)]))


def licenses_in(expression: str) -> list[str]:
    """Split an SPDX expression into its licences, each with its exception.

    Parameters
    ----------
    expression : str
        Without parentheses, for example ``MIT AND Apache-2.0 WITH LLVM-exception``.
    """
    return [each.strip() for each in re.split(r" AND | OR ", expression)]


def read_wheel(path: Path, known: Path = KNOWN) -> Wheel:
    """Read what a wheel holds, and compare it with what is known.

    Parameters
    ----------
    path : Path
        The wheel.
    known : Path
        The file of known licences; the texts lie in a folder beside it.

    Returns
    -------
    Wheel
        The wheel with the parts that it has on its platform.

    Raises
    ------
    LicenseError
        If the wheel is not known, says another licence than is known, holds a library that is not known or no
        licence's text, or is under a licence that is not allowed.
    """
    table = tomllib.loads(known.read_text(encoding="utf-8"))
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        (place,) = (name for name in names if re.fullmatch(r"[^/]+\.dist-info/METADATA", name))
        metadata = HeaderParser().parsestr(archive.read(place).decode("utf-8"))
        texts = {
            name: archive.read(name).decode("utf-8", errors="replace")
            for name in sorted(names)
            if _TEXT.match(PurePosixPath(name).name) and not name.endswith((".py", ".pyc", "/"))
        }
    name, version = str(metadata["Name"]), str(metadata["Version"])
    if name.lower() not in table:
        raise LicenseError(f"{known.name} says nothing about {name}, which is to ride in the zip.")
    entry = table[name.lower()]
    if not any(text.startswith(f"{PurePosixPath(place).parent}/") for text in texts):
        raise LicenseError(f"{path.name} has no text of its licence.")
    libraries = {PurePosixPath(each).name for each in names if _LIBRARY.search(each)}
    # Modules are the wheel's own: numba.cpython-313-x86_64-linux-gnu.so, _core.abi3.so.
    libraries = {each for each in libraries if not re.search(r"\.(cpython-|abi3\.)|^_", each)}
    parts: list[Part] = []
    known_libraries: set[str] = set()
    for part in entry.get("parts", []):
        patterns = part.get("libraries", [])
        there = {each for each in libraries for pattern in patterns if fnmatch.fnmatch(each, pattern)}
        known_libraries |= there
        if there or not patterns:
            text = (
                (known.parent / "licenses" / part["text"]).read_text(encoding="utf-8")
                if "text" in part
                else ""
            )
            parts.append(Part(part["name"], part["license"], text))
    unknown = sorted(libraries - known_libraries)
    if unknown:
        raise LicenseError(f"{path.name} holds {', '.join(unknown)}, about which {known.name} says nothing.")
    wheel = Wheel(path, name, version, entry["license"], tuple(parts), texts, _requires(metadata))
    _check(wheel, metadata.get("License-Expression"), table["allowed"], known)
    return wheel


def _requires(metadata: Message) -> frozenset[str]:
    """Return what a distribution's metadata say that it needs, leaving out what is optional."""
    lines = [str(line) for line in metadata.get_all("Requires-Dist", []) if "extra ==" not in str(line)]
    return frozenset(match[0].lower() for line in lines if (match := re.match(r"[\w.-]+", line)))


def _check(wheel: Wheel, said: str | None, allowed: list[str], known: Path) -> None:
    if said is not None and not set(licenses_in(said)) <= set(licenses_in(wheel.expression)):
        raise LicenseError(f'{wheel.path.name} says "{said}", and {known.name} "{wheel.expression}".')
    if refused := [each for each in licenses_in(wheel.expression) if each not in allowed]:
        raise LicenseError(
            f"{wheel.path.name} is under {', '.join(refused)}, which {known.name} does not list as "
            "compatible with the GPL."
        )


def notices(wheels: list[Wheel]) -> str:
    """Write the file that tells users what rides in the zip, under which licences.

    Parameters
    ----------
    wheels : list of Wheel
        The wheels of one zip.

    Returns
    -------
    str
        A list, then every licence's text.
    """
    lines = [
        "Potmesil Camera is under the GNU General Public License, version 3 or later: see LICENSE.",
        "This zip also holds the packages below, each under its own licence. The texts follow.",
        "",
    ]
    for wheel in wheels:
        lines.append(f"{wheel.name} {wheel.version}: {wheel.license}")
        lines += [f"    with {part.name}: {part.license}" for part in wheel.parts]
    for wheel in wheels:
        texts = wheel.texts | {
            f"{part.name}, in {wheel.name}": part.text for part in wheel.parts if part.text
        }
        for name, text in texts.items():
            body = text.replace("\r\n", "\n").strip("\n")
            lines += ["", _RULE, name, _RULE, "", body]
    return "\n".join(lines) + "\n"
