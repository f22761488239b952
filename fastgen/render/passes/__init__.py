"""Passes of the renderer: each reads named textures, writes named targets, and binds only those."""
