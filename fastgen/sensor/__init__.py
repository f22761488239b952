"""The camera as a sensor and the weather before it: what becomes of a clean rendering."""
