"""The errors a user meets. Each one names the object, where it stands, the value that is wrong, and the remedy.

`str(error)` is always one line, so that the CLI can print it as it is and exit with code 2.
"""

from __future__ import annotations


class GlcError(Exception):
    """Base of every error that bad input or a lacking machine can cause.

    Args:
        what: the object and what is wrong with it ("material 'glass': ior 0.2 is below 1").
        where: file, pass, shader line or option that it stands in; empty when there is none.
        remedy: what the user can do about it; empty when nothing is known to help.
    """

    def __init__(self, what: str, *, where: str = "", remedy: str = "") -> None:
        self.what = what
        self.where = where
        self.remedy = remedy
        super().__init__(self.one_line())

    def one_line(self) -> str:
        """The whole error on one line: where, what, and the remedy."""
        text = f"{self.where}: {self.what}" if self.where else self.what
        if self.remedy:
            text = f"{text}; {self.remedy}"
        return " ".join(text.split())


class UsageError(GlcError):
    """An option or argument that does not make sense."""


class SceneError(GlcError):
    """A scene file, mesh, material, light or camera that cannot be used."""


class ShaderError(GlcError):
    """A shader that does not load, include, compile or link, or a uniform that it does not have."""


class GraphError(GlcError):
    """A frame graph that is not well formed: cycle, two writers, unknown resource, undeclared read."""


class DeviceError(GlcError):
    """No usable OpenGL context, or a feature that the driver lacks."""


class ResourceLimitError(GlcError):
    """Something larger than the driver's or the project's limit: a texture, a mesh, a count."""
