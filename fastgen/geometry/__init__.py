"""Container and spreader meshes, their unfolding, and the damage displacement law."""
