"""A container port in Blender, path-traced to panoramas by build_panoramas.py."""
