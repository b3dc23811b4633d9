"""The papers' figures and tables, made again: `python -m figures`, or `make figures`."""
