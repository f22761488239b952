"""What renderer.py is made of: shader programs, buffers, textures, targets, passes; and baking."""
