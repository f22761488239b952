"""OpenGL contexts without a screen: EGL and OSMesa."""
