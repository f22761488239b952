"""Sampling of scenes: (config, seed, index) -> Scene, one random stream per property."""
