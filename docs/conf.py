"""How Sphinx builds the documentation: `make docs`."""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# Only the documentation does this; the extension never edits sys.path.
sys.path.insert(0, str(ROOT))

from potmesil_addon import __version__  # noqa: E402 - needs the path above

project = "Potmesil Camera"
author = "Potmesil Camera developers"
copyright = "2026, Potmesil Camera developers"
version = release = __version__

extensions = ["myst_parser", "numpydoc", "sphinx.ext.autodoc", "sphinx.ext.mathjax"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]

html_theme = "furo"
html_title = f"Potmesil Camera {version}"

# Names in single backticks in docstrings are Python's.
default_role = "py:obj"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
# The docstrings give every type with its shape and unit.
autodoc_typehints = "none"
numpydoc_show_class_members = False
