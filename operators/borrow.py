"""Scene settings that are changed for a while and put back, also after an error or a cancel."""

from __future__ import annotations

import contextlib
from types import TracebackType
from typing import Any

from .animation import curves_of


class Borrowed:
    """Remembers what settings were and puts them back; what animates them is muted meanwhile.

    Works as a context manager, or with `give_back` where the work spans several calls of a modal
    operator.
    """

    def __init__(self) -> None:
        # What is borrowed twice goes back to what it was at first.
        self._before: dict[tuple[Any, str], Any] = {}

    def set(self, owner: Any, name: str, value: Any) -> None:
        """Change a setting.

        Parameters
        ----------
        owner : object
            Blender data that has the setting.
        name : str
            The setting's name.
        value : object
            Its value for now.
        """
        self.set_all(owner, {name: value})

    def set_all(self, owner: Any, values: dict[str, Any]) -> None:
        """Change several settings of which the first ones limit or change the later ones.

        Parameters
        ----------
        owner : object
            Blender data that has the settings.
        values : dict of str to object
            Their values for now, in the order in which they can be set and put back.
        """
        for name in values:
            # A frame is evaluated again before it renders, and animation would win over us.
            for curve in curves_of(owner, name):
                self._before.setdefault((curve, "mute"), curve.mute)
                curve.mute = True
            self._before.setdefault((owner, name), getattr(owner, name))
        for name, value in values.items():
            if getattr(owner, name) != value:
                setattr(owner, name, value)

    def give_back(self) -> None:
        """Put every setting back; what was deleted in the meantime is left alone."""
        before, self._before = self._before, {}
        for (owner, name), value in before.items():
            with contextlib.suppress(ReferenceError):
                if getattr(owner, name) != value:
                    setattr(owner, name, value)

    def __enter__(self) -> Borrowed:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.give_back()
