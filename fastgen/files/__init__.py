"""Bytes: images, YAML and glTF to and from them, and files that are there whole or not at all."""
