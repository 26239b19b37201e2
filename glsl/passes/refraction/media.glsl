// What a ray runs in between the first and the second specular surface: one of these, or object index + 1 of an interface or solid.
#define MEDIUM_AIR 0.0
#define MEDIUM_OF_EYE -1.0
