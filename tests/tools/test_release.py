"""A release says what it is of, holds what is known and allowed, and is the same each time it is made."""

from __future__ import annotations

import re
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

import bill_of_materials  # noqa: E402
import build_extension  # noqa: E402
import fetch_wheels  # noqa: E402
import release  # noqa: E402
import third_party  # noqa: E402

KNOWN = """
allowed = ["BSD-3-Clause", "MIT", "Apache-2.0 WITH LLVM-exception"]
[blur]
license = "MIT"
parts = [
  { name = "LLVM", license = "Apache-2.0 WITH LLVM-exception", libraries = ["libLLVM*"] },
  { name = "zlib", license = "BSD-3-Clause", text = "zlib.txt" },
]
[closed]
license = "LicenseRef-Closed"
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Copies of the files that name the version, committed."""
    for name in ("blender_manifest.toml", "pyproject.toml", "CITATION.cff", "potmesil_addon/__init__.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        text = (ROOT / name).read_text(encoding="utf-8")
        (tmp_path / name).write_text(text.replace(_version(), "1.2.3"), encoding="utf-8")
    (tmp_path / "CHANGELOG.md").write_text("# Changelog\n\n## 1.2.3 - 2026-11-23\n\n### Added\n\n- Blur.\n")
    git = ["git", "-C", str(tmp_path), "-c", "user.name=A", "-c", "user.email=a@example.org"]
    for words in (["init", "-q"], ["add", "-A"], ["commit", "-q", "-m", "All", "--no-gpg-sign"]):
        subprocess.run([*git, *words], check=True)
    return tmp_path


def _version() -> str:
    (found,) = re.findall(
        r'(?m)^version = "(.*)"', (ROOT / "blender_manifest.toml").read_text(encoding="utf-8")
    )
    return str(found)


@pytest.fixture
def known(tmp_path: Path) -> Path:
    """A file of known licences, and a text that a wheel lacks."""
    path = tmp_path / "known" / "licenses.toml"
    (path.parent / "licenses").mkdir(parents=True)
    path.write_text(KNOWN)
    (path.parent / "licenses" / "zlib.txt").write_text("Text of zlib")
    return path


def make_wheel(
    folder: Path, name: str = "blur", files: tuple[str, ...] = ("LICENSE",), metadata: str = ""
) -> Path:
    path = folder / f"{name}-1.0-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(f"{name}/__init__.py", "")
        needs = "Requires-Dist: numpy>=2\nRequires-Dist: sphinx; extra == 'doc'\n"
        said = f"Name: {name}\nVersion: 1.0\n{needs}{metadata}"
        archive.writestr(f"{name}-1.0.dist-info/METADATA", said)
        for each in files:
            archive.writestr(each if "/" in each else f"{name}-1.0.dist-info/{each}", f"Text of {each}")
    return path


def test_what_the_project_is_could_be_released() -> None:
    version, changes = release.check_versions(ROOT, allow_unreleased=True)
    assert version == _version()
    assert changes.text


def test_versions_that_agree_are_a_release(project: Path) -> None:
    version, changes = release.check_versions(project, allow_unreleased=False, tag="v1.2.3")
    assert (version, changes.date) == ("1.2.3", "2026-11-23")
    assert changes.text == "### Added\n\n- Blur."


@pytest.mark.parametrize(
    ("name", "old", "new", "said"),
    [
        ("pyproject.toml", '"1.2.3"', '"1.2.4"', "pyproject.toml of 1.2.4"),
        ("CITATION.cff", "version: 1.2.3", "version: 9", "CITATION.cff of 9"),
        ("potmesil_addon/__init__.py", '"1.2.3"', '"1.2"', "__init__.py of 1.2;"),
        ("CHANGELOG.md", "1.2.3 - 2026-11-23", "Unreleased", 'is "Unreleased"; call it "1.2.3 - '),
        ("CHANGELOG.md", "1.2.3 - ", "1.2.2 - ", 'is "1.2.2"'),
        ("CHANGELOG.md", " - 2026-11-23", "", "has no date"),
        ("CHANGELOG.md", "2026-11-23", "soon", "has no date"),
        ("CHANGELOG.md", "### Added\n\n- Blur.\n", "## 1.2.2 - 2026-11-01\n\n- Old.\n", "is empty"),
        ("CHANGELOG.md", "## 1.2.3", "# 1.2.3", "has no section"),
    ],
)
def test_what_disagrees_is_named(project: Path, name: str, old: str, new: str, said: str) -> None:
    text = (project / name).read_text(encoding="utf-8")
    assert old in text
    (project / name).write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(release.ReleaseError, match=re.escape(said)):
        release.check_versions(project, allow_unreleased=False)


def test_a_tag_has_to_fit(project: Path) -> None:
    with pytest.raises(release.ReleaseError, match=r"tag the commit v1\.2\.3"):
        release.check_versions(project, allow_unreleased=False, tag="v1.2.4")


def test_a_release_is_of_a_commit_alone(project: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    commit = release.check_clean(project)
    (project / "potmesil_addon" / "local.py").write_text("")
    with pytest.raises(release.ReleaseError, match=r"in no commit \(potmesil_addon/local.py\)"):
        release.check_clean(project)
    folder = tmp_path_factory.mktemp("clone") / "source"
    release.clone(project, commit, folder)
    assert (folder / "blender_manifest.toml").is_file()
    assert not (folder / "potmesil_addon" / "local.py").exists()


def test_every_pinned_wheel_has_a_hash() -> None:
    hashes = fetch_wheels.read_hashes()
    assert all(re.fullmatch(r"[0-9a-f]{64}", digest) for digest in hashes.values())
    known = {tuple(name.lower().split("-")[:2]) for name in hashes}
    platforms = {"linux-x64": "manylinux", "windows-x64": "win_amd64", "macos-arm64": "macosx"}
    for each in fetch_wheels.RELEASES:
        platform, python = fetch_wheels.split_release(each)
        for name, version in fetch_wheels.read_pins(python).items():
            assert (name.lower(), version) in known
            fitting = [
                wheel
                for wheel in hashes
                if wheel.lower().startswith(f"{name.lower()}-{version}-")
                and (
                    (f"-{python}-" in wheel and platforms[platform] in wheel)
                    or wheel.endswith("-py3-none-any.whl")
                )
            ]
            assert len(fitting) == 1, (each, name)


def test_another_wheel_of_the_same_name_is_refused(tmp_path: Path) -> None:
    wheel = make_wheel(tmp_path)
    hashes = {wheel.name: fetch_wheels.hash_of(wheel)}
    fetch_wheels.check_hashes([wheel], hashes)
    wheel.write_bytes(wheel.read_bytes() + b"0")
    with pytest.raises(ValueError, match="is not the wheel whose hash"):
        fetch_wheels.check_hashes([wheel], hashes)
    with pytest.raises(ValueError, match="has no hash of"):
        fetch_wheels.check_hashes([wheel], {})


def test_a_wheel_is_what_is_known_of_it(tmp_path: Path, known: Path) -> None:
    plain = third_party.read_wheel(make_wheel(tmp_path), known)
    assert [part.name for part in plain.parts] == ["zlib"]
    assert plain.expression == "MIT AND BSD-3-Clause"
    assert plain.requires == {"numpy"}
    wheel = third_party.read_wheel(
        make_wheel(tmp_path, files=("LICENSE", "blur.libs/libLLVM-22.so.1")), known
    )
    assert wheel.expression == "MIT AND Apache-2.0 WITH LLVM-exception AND BSD-3-Clause"
    text = third_party.notices([wheel])
    for said in ("blur 1.0: MIT", "with LLVM: Apache-2.0 WITH", "Text of LICENSE", "Text of zlib"):
        assert said in text


@pytest.mark.parametrize(
    ("wheel", "said"),
    [
        ({"name": "stranger"}, "says nothing about stranger"),
        ({"name": "closed"}, "LicenseRef-Closed"),
        ({"files": ()}, "has no text of its licence"),
        # The code's own text is not the distribution's.
        ({"files": ("blur/LICENSE",)}, "has no text of its licence"),
        ({"files": ("LICENSE", "blur.libs/libavcodec.so.61")}, "holds libavcodec.so.61, about which"),
        ({"metadata": "License-Expression: GPL-2.0-only\n"}, 'says "GPL-2.0-only"'),
    ],
)
def test_what_is_not_known_or_not_allowed_does_not_ride(
    tmp_path: Path, known: Path, wheel: dict[str, Any], said: str
) -> None:
    with pytest.raises(third_party.LicenseError, match=re.escape(said)):
        third_party.read_wheel(make_wheel(tmp_path, **wheel), known)


def test_every_pinned_distribution_has_a_licence() -> None:
    table = third_party.tomllib.loads(third_party.KNOWN.read_text(encoding="utf-8"))
    allowed = table.pop("allowed")
    for each in fetch_wheels.PYTHON_VERSIONS:
        assert {name.lower() for name in fetch_wheels.read_pins(each)} == set(table)
    for entry in table.values():
        for part in [entry, *entry.get("parts", [])]:
            assert set(third_party.licenses_in(part["license"])) <= set(allowed)
            if "text" in part:
                assert (third_party.KNOWN.parent / "licenses" / part["text"]).read_text(encoding="utf-8")


def test_a_zip_made_again_has_the_same_bytes(tmp_path: Path) -> None:
    made = []
    for number, names in enumerate((["b.py", "a.py", "w.whl"], ["w.whl", "a.py", "b.py"])):
        path = tmp_path / f"{number}.zip"
        with zipfile.ZipFile(path, "w") as archive:
            for name in names:
                entry = zipfile.ZipInfo(name, (2026, 1 + number, 1, 0, 0, 0))
                entry.compress_type = zipfile.ZIP_STORED if name == "w.whl" else zipfile.ZIP_DEFLATED
                entry.external_attr = (0o600 + 0o44 * number) << 16
                archive.writestr(entry, name * 100)
        build_extension.make_reproducible(path, 1_790_000_000)
        made.append(path)
    assert made[0].read_bytes() == made[1].read_bytes()
    with zipfile.ZipFile(made[0]) as archive:
        assert archive.namelist() == ["a.py", "b.py", "w.whl"]
        assert archive.read("b.py") == b"b.py" * 100
        assert archive.getinfo("w.whl").compress_type == zipfile.ZIP_STORED
        assert archive.getinfo("a.py").date_time == (2026, 9, 21, 14, 13, 20)


def test_the_extension_built_again_has_the_same_bytes(tmp_path: Path) -> None:
    pytest.importorskip("bpy", reason="the bpy module is not installed")
    first, second = (build_extension.build(tmp_path / name, None) for name in ("first", "second"))
    assert first.read_bytes() == second.read_bytes()


def test_the_bill_names_all_and_what_needs_what(tmp_path: Path, known: Path) -> None:
    wheel = third_party.read_wheel(make_wheel(tmp_path), known)
    manifest = {
        "id": "potmesil_camera",
        "version": "1.2.3",
        "tagline": "Blur",
        "license": ["SPDX:GPL-3.0-or-later"],
        "blender_version_min": "5.1.0",
        "blender_version_max": "5.3.0",
    }
    archive = tmp_path / "potmesil_camera-1.2.3.zip"
    archive.write_bytes(b"zip")
    bill = bill_of_materials.bill_of_materials(archive, manifest, [wheel], "2.3.4", 1_790_000_000)
    again = bill_of_materials.bill_of_materials(archive, manifest, [wheel], "2.3.4", 1_790_000_000)
    assert bill == again
    assert (bill["bomFormat"], bill["specVersion"]) == ("CycloneDX", "1.6")
    assert bill["metadata"]["timestamp"] == "2026-09-21T14:13:20Z"
    root = bill["metadata"]["component"]
    assert root["hashes"][0]["content"] == fetch_wheels.hash_of(archive)
    parts = {each["name"]: each for each in bill["components"]}
    assert set(parts) == {"Blender", "numpy", "blur"}
    assert parts["Blender"]["properties"][0]["value"] == "5.1.0 to before 5.3.0"
    assert parts["blur"]["purl"] == "pkg:pypi/blur@1.0?file_name=blur-1.0-py3-none-any.whl"
    assert parts["blur"]["hashes"] == [{"alg": "SHA-256", "content": fetch_wheels.hash_of(wheel.path)}]
    assert parts["blur"]["components"][0]["licenses"] == [{"expression": "BSD-3-Clause"}]
    needs = {each["ref"]: each["dependsOn"] for each in bill["dependencies"]}
    refs = {each["bom-ref"] for each in bill["components"]}
    assert set(needs[root["bom-ref"]]) == refs
    assert needs[parts["blur"]["bom-ref"]] == [parts["numpy"]["bom-ref"]]


@pytest.mark.parametrize(
    "path", sorted((ROOT / ".github" / "workflows").glob("*.yml")), ids=lambda path: path.name
)
def test_workflows_are_pinned_and_make_what_is_there(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    actions = re.findall(r"uses:\s*(.*)", text)
    assert actions
    for action in actions:
        assert re.fullmatch(r"[\w.-]+/[\w./-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", action), action
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"(?m)^([a-z-]+):", makefile))
    used = re.findall(r"\bmake (?:-s )?([a-z][a-z-]*)", "\n".join(re.findall(r"(?m)^\s.*", text)))
    assert used
    assert set(used) <= targets
    for tool in re.findall(r"\btools/[\w.]+", text) + re.findall(r"requirements/[\w.-]+\.txt", text):
        assert (ROOT / tool).is_file(), tool
    # Whoever may change what is run gains nothing by it.
    assert re.search(r"(?m)^permissions:( \{\}|\n  contents: read)$", text)
    assert text.count("timeout-minutes:") == text.count("runs-on:")
    assert text.count("persist-credentials: false") == text.count("actions/checkout@")
    assert "${{" not in "".join(re.findall(r"run:.*", text))
    for shown in re.findall(r"blender: \"([\d.]+)\"", text):
        assert (ROOT / "requirements" / f"blender-{shown}.txt").is_file()


def test_every_blender_is_tested_and_every_zip_is_tried() -> None:
    text = (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")
    assert set(re.findall(r"release: ([\w-]+)", text)) == set(fetch_wheels.RELEASES)
    named = {path.stem.removeprefix("blender-") for path in (ROOT / "requirements").glob("blender-*.txt")}
    assert set(re.findall(r'blender: "([\d.]+)"', text)) == named
    assert {version for versions in release.BLENDERS.values() for version in versions} == named
