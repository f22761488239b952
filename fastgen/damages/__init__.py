"""Kinds of damage of fastgen, one module each, and the forms and draws that they share.

The module of a kind has its name and holds its `KIND`. `scene/damage_kinds.py` describes kinds and
finds them by name.
"""
