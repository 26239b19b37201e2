#include "interface/fullscreen_far.glsl"
