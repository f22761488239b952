"""A container port in Blender, path traced to panoramas: see build_panoramas.py."""
