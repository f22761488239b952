"""What gl.py is made of: OpenGL contexts of EGL and OSMesa."""
