"""Everything that uses OpenGL: contexts, passes, shader programs, targets and CUDA."""
