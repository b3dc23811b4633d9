"""The errors that end in one clear sentence, and the exit status each one stands for."""

from __future__ import annotations

from typing import ClassVar, Final

EXIT_DONE: Final = 0
EXIT_USAGE: Final = 2
EXIT_INPUT: Final = 3
EXIT_FAILED: Final = 4
EXIT_MEMORY: Final = 33


class PotmesilError(Exception):
    """Something the user can read and act on.

    The message is one sentence that says what is wrong and what to do. `exit_status` is what the
    command line returns for it.
    """

    exit_status: ClassVar[int] = EXIT_FAILED


class SettingsError(PotmesilError, ValueError):
    """A setting is missing, out of range or contradicts another one."""

    exit_status: ClassVar[int] = EXIT_USAGE


class InputError(PotmesilError):
    """An input file is missing, damaged, or lacks what the work needs."""

    exit_status: ClassVar[int] = EXIT_INPUT


class OutputError(PotmesilError):
    """A result could not be written."""

    exit_status: ClassVar[int] = EXIT_FAILED


class MemoryLimitError(PotmesilError):
    """The work takes more memory than it may have, also in small parts."""

    exit_status: ClassVar[int] = EXIT_MEMORY
