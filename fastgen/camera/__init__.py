"""Cameras: projection, lens distortion, sensor, weather and tone curve."""
