"""Bytes: pixels and scenes encoded, hashed, and stored whole or not at all."""
