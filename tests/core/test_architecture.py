"""What may import what: the core knows nothing of Blender, and nothing bends Python's own machinery."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from .helpers import ROOT

CORE = sorted((ROOT / "potmesil_addon").rglob("*.py"))
BLENDER_SIDE = sorted(path for folder in ("operators", "ui") for path in (ROOT / folder).rglob("*.py"))
SHIPPED = [ROOT / "__init__.py", *CORE, *BLENDER_SIDE]

BLENDERS_MODULES = re.compile(
    r"(bpy|bpy_extras|gpu|gpu_extras|mathutils|blf|bmesh|aud|freestyle|bl_\w+|_bpy)(\.|$)"
)


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


def imports(tree: ast.AST) -> Iterator[tuple[int, str, int]]:
    """Yield level (0 is absolute), dotted name and line of every import statement."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((0, alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            module = node.module or ""
            for alias in node.names:
                yield node.level, f"{module}.{alias.name}".strip("."), node.lineno


def dotted_names(tree: ast.AST) -> Iterator[tuple[str, int]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute | ast.Name):
            yield ast.unparse(node), node.lineno


def test_the_walk_sees_the_code() -> None:
    names = {name_of(path) for path in SHIPPED}
    assert {"__init__.py", "potmesil_addon/lens.py", "operators/__init__.py", "ui/__init__.py"} <= names


def test_the_pattern_knows_blenders_modules() -> None:
    for name in ("bpy", "bpy.types", "gpu", "mathutils.Vector", "bl_ui", "bpy_extras.io_utils", "blf"):
        assert BLENDERS_MODULES.match(name), name
    for name in ("blend", "gputools", "numba", "bpylike"):
        assert not BLENDERS_MODULES.match(name), name


@pytest.mark.parametrize("path", CORE, ids=name_of)
def test_core_imports_nothing_of_blenders(path: Path) -> None:
    found = [(name, line) for level, name, line in imports(tree_of(path)) if BLENDERS_MODULES.match(name)]
    assert not found


@pytest.mark.parametrize("path", CORE, ids=name_of)
def test_core_imports_by_statement_only(path: Path) -> None:
    """A module named in a string would pass the other tests here unseen."""
    tree = tree_of(path)
    found = {name for _, name, _ in imports(tree) if name.split(".")[0] in ("importlib", "runpy", "imp")}
    # To say where packages are, and no more.
    assert not found - ({"importlib.util"} if path.name == "beside.py" else set())
    assert not [line for name, line in dotted_names(tree) if name.startswith("importlib.import")]
    assert not [line for name, line in dotted_names(tree) if name in ("__import__", "exec", "eval")]


@pytest.mark.parametrize("path", SHIPPED, ids=name_of)
def test_no_absolute_import_of_the_core(path: Path) -> None:
    """Inside Blender the package is bl_ext.<repository>.<id>, which no absolute import can know."""
    own = ("potmesil_addon", "operators", "ui", "bl_ext")
    found = [
        (name, line)
        for level, name, line in imports(tree_of(path))
        if level == 0 and name.split(".")[0] in own
    ]
    assert not found


@pytest.mark.parametrize("path", BLENDER_SIDE, ids=name_of)
def test_operators_and_ui_reach_the_core_relatively(path: Path) -> None:
    found = [(level, name, line) for level, name, line in imports(tree_of(path)) if "potmesil_addon" in name]
    assert all(level == 2 and name.startswith("potmesil_addon") for level, name, _ in found), found


def test_something_reaches_the_core() -> None:
    names = [name for path in BLENDER_SIDE for _, name, _ in imports(tree_of(path))]
    assert any(name.startswith("potmesil_addon.") for name in names)


@pytest.mark.parametrize("path", CORE, ids=name_of)
def test_core_does_not_reach_up(path: Path) -> None:
    depth = len(path.relative_to(ROOT).parts) - 1
    assert all(level <= depth for level, _, _ in imports(tree_of(path)))


@pytest.mark.parametrize("path", SHIPPED, ids=name_of)
def test_no_edit_of_sys_path(path: Path) -> None:
    tree = tree_of(path)
    touched = ("sys.path", "sys.meta_path", "sys.path_hooks", "site.addsitedir")
    assert not [(name, line) for name, line in dotted_names(tree) if name in touched]
    assert not [name for _, name, _ in imports(tree) if name in touched or name.split(".")[0] == "site"]


@pytest.mark.parametrize("path", SHIPPED, ids=name_of)
def test_no_threads_of_our_own(path: Path) -> None:
    """Python threads that outlive their caller crash Blender; numba's own are joined by each kernel."""
    own = ("threading", "_thread", "concurrent", "multiprocessing", "asyncio")
    assert not [(name, line) for _, name, line in imports(tree_of(path)) if name.split(".")[0] in own]


@pytest.mark.parametrize("path", SHIPPED, ids=name_of)
def test_numba_has_one_door(path: Path) -> None:
    uses = [line for _, name, line in imports(tree_of(path)) if name.split(".")[0] in ("numba", "llvmlite")]
    assert not uses or path.name == "jit.py"


@pytest.mark.parametrize("path", CORE, ids=name_of)
def test_everything_public_in_the_core_has_a_docstring(path: Path) -> None:
    tree = tree_of(path)
    assert ast.get_docstring(tree)
    missing = []
    for node in tree.body:
        if not isinstance(node, ast.FunctionDef | ast.ClassDef) or node.name.startswith("_"):
            continue
        if not ast.get_docstring(node):
            missing.append(node.name)
        if isinstance(node, ast.ClassDef):
            methods = [child for child in node.body if isinstance(child, ast.FunctionDef)]
            missing += [
                f"{node.name}.{method.name}"
                for method in methods
                if not method.name.startswith("_") and not ast.get_docstring(method)
            ]
    assert not missing


def test_root_imports_nothing_when_it_is_imported() -> None:
    """Tests, linters and the farm's command import the folder where no bpy is."""
    for node in tree_of(ROOT / "__init__.py").body:
        if isinstance(node, ast.Import):
            raise AssertionError(f"line {node.lineno} imports")
        if isinstance(node, ast.ImportFrom):
            assert node.module == "__future__", f"line {node.lineno} imports"
        assert isinstance(node, ast.Expr | ast.ImportFrom | ast.FunctionDef | ast.Assign | ast.AnnAssign)


def python(code: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_core_runs_where_blender_is_not() -> None:
    names = [f"potmesil_addon.{path.stem}" for path in CORE if not path.stem.startswith("__")]
    python(
        "import sys\n"
        "for name in ('bpy', 'mathutils', 'gpu', 'bpy_extras'): sys.modules[name] = None\n"
        f"import importlib\nfor name in {names!r}: importlib.import_module(name)\n"
    )


def test_what_blender_loads_at_start_up_is_light() -> None:
    """The registered modules import these; numba, scipy and OpenEXR would cost most of a second."""
    loaded = python(
        "import sys\n"
        "from potmesil_addon import camera, errors, frames, inspection, lens, preflight, samples\n"
        "print([name for name in ('numba', 'scipy', 'OpenEXR') if name in sys.modules])\n"
    )
    assert loaded.strip() == "[]"
