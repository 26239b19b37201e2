"""What the options of every frame mean, one line each with unit and range; their values: `renderer.BASE_LADDER`."""

from __future__ import annotations

OPTION_HELP: dict[str, str] = {
    "shadow_size": "a shadow map has about this^2 texels (1..16384)",
    "rsm_size": "a reflective shadow map has about this^2 texels (1..16384)",
    "refraction": "how eye rays are solved: cascade, newton, hierarchical, dda or sousa",
    "refraction_iterations": "look-ups of Newton's method an eye ray (1..16384)",
    "refraction_steps": "of the march that follows a refracted ray (1..16384)",
    "reflection_steps": "of the march that follows a reflected ray (1..16384)",
    "reflection_history": "reflected rays are solved from where they ended in the last frame (true, false; cascade)",
    "depth_layers": "2: eye rays that end behind something are solved in a second layer of opaque surfaces (1, 2)",
}
