"""Frame graph: passes declare what they read and write; the graph culls, orders and allocates. Imports no GL.

Example:
    >>> graph = FrameGraph()
    >>> graph.add(PassDecl("sky", {"sky.radiance": TextureDesc("rgba16f", (64, 32))}, execute=print))
    >>> plan = graph.compile(outputs=("sky.radiance",))
    >>> [step.name for step in plan.steps]
    ['sky']
"""

from glcaustics.graph.compile import FrameGraph
from glcaustics.graph.plan import LeftOut, Plan, Step, check_history, check_read, check_write
from glcaustics.graph.resources import FORMAT_BYTES, PassDecl, TextureDesc

__all__ = [
    "FORMAT_BYTES",
    "FrameGraph",
    "LeftOut",
    "PassDecl",
    "Plan",
    "Step",
    "TextureDesc",
    "check_history",
    "check_read",
    "check_write",
]
