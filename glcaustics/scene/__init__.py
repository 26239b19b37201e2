"""Scenes as plain data, and the ways to load them. NumPy only, no OpenGL."""

from glcaustics.scene.load import builtin_scenes, load_scene, scenes_root
from glcaustics.scene.model import (
    Camera,
    Image,
    Instance,
    Light,
    LightKind,
    Material,
    Mesh,
    OpticalKind,
    Scene,
    Sky,
    WaterBody,
)

__all__ = [
    "Camera",
    "Image",
    "Instance",
    "Light",
    "LightKind",
    "Material",
    "Mesh",
    "OpticalKind",
    "Scene",
    "Sky",
    "WaterBody",
    "builtin_scenes",
    "load_scene",
    "scenes_root",
]
