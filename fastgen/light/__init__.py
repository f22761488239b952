"""What environment.py is made of, and what stands in its way: suns, sky, shadows, reflections."""
