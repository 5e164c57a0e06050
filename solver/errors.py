"""What can go wrong, as one small tree.

RadiosityError              anything the user can mend; the message names the object, the value, the next step
|-- SceneError              the scene's own data: not finite, out of range, wrong shape
|-- SettingsError           a setting's value
|-- NothingToBake           no receiver at all
|-- UnwrapError             no usable layout of lumels
|-- OutputError             a file or folder that can't be written or read
`-- Cancelled               the user asked to stop
"""

from __future__ import annotations


class RadiosityError(Exception):
    """Something the user can mend: the message names the object, the value and the next step."""

    exit_code = 1


class SceneError(RadiosityError):
    """The scene's data can't be used."""


class SettingsError(RadiosityError):
    """A setting has a value that makes no sense."""

    exit_code = 2


class NothingToBake(RadiosityError):
    """There is no surface to receive light, or no light to receive."""

    exit_code = 3


class UnwrapError(RadiosityError):
    """No usable layout of lumels could be made or found."""


class OutputError(RadiosityError):
    """A file or folder can't be read or written."""


class Cancelled(RadiosityError):
    """The user asked to stop."""

    exit_code = 130
