"""Decal artwork, lettering and container identifiers, independent of any scene."""
