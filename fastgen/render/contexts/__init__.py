"""Headless OpenGL contexts: EGL and OSMesa."""
