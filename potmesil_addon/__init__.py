"""The core of Potmesil Camera: optics, point-spread functions, processors and samples files.

Nothing in this package knows Blender. It works on numpy arrays and frozen dataclasses, in metres, and
runs by itself as ``python -m potmesil_addon``.

The papers are cited by name and number throughout:

- *1981*: Potmesil and Chakravarty, "A Lens and Aperture Camera Model for Synthetic Image Generation",
  SIGGRAPH 1981.
- *TOG 1982*: the same authors, "Synthetic Image Generation with a Lens and Aperture Camera Model",
  ACM Transactions on Graphics 1(2), 1982.
- *1983*: the same authors, "Modeling Motion Blur in Computer-Generated Images", SIGGRAPH 1983.
"""

__version__ = "0.1.0"
