"""Scenes built by script, each in a module of its own; `python -m sample_scenes NAME` saves one."""
