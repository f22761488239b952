"""Shared parts of the examples: cached images, training loop, detector, metrics and charts."""
