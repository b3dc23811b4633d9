"""Entry point of ``python -m potmesil_addon``."""

from .cli import main

raise SystemExit(main())
