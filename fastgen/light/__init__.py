"""Light beside environment.py, and what is in its way: suns, sky, shadows, reflections, tones."""
