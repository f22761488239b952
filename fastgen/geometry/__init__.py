"""What container.py and spreader.py are made of: triangle meshes, their unfolding, and parts."""
