// Scar: bare surface that damage leaves.

struct Scar {
    float wear;    // Share that has lost its paint, 0..1.
    float fresh;   // Share of it that has not rusted yet.
    vec3 albedo;   // Of the fresh share.
    bool over_repairs;   // Whether it is newer than repairs, so that they do not cover it.
};
const Scar NO_SCAR = Scar(0.0, 0.0, vec3(0.0), false);
