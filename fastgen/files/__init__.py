"""Atomic file writes, image encoders and decoders, and the disk cache."""
