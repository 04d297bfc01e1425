"""The one error type that is the user's to mend."""

from __future__ import annotations


class InputError(ValueError):
    """Something that the user gave cannot be used.

    The message is one sentence that names the file (or the setting) and says what to do.
    The command line prints it alone, without a traceback, and exits with 2.
    """
