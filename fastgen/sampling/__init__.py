"""Drawing a scene: (config, seed, index) -> Scene, each property from its own random stream."""
