// The camera's raster space (see common/raster_ray.glsl). What a host engine replaces by its own view uniforms.
uniform mat4 u_raster_from_world;
uniform vec2 u_raster_size;          // pixels
