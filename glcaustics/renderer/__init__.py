"""From a scene to a frame: analyse, declare, compile the graph, run it, read the result back."""

from glcaustics.renderer.aov import AOVS
from glcaustics.renderer.declare import plan_frame
from glcaustics.renderer.frame import Frame
from glcaustics.renderer.options import resolve_options
from glcaustics.renderer.renderer import Renderer

__all__ = ["AOVS", "Frame", "Renderer", "plan_frame", "resolve_options"]
