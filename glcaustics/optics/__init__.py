"""Float64 oracle of the tests and the bench: Fresnel, refraction, closed-form caustics, reference beams. No OpenGL.

Stands alone: it imports nothing of the renderer, so that an error there cannot hide here.
"""
