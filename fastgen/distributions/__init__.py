"""What scenes are drawn from, below config.py and sampling.py: ranges of cameras, damages, prints
and the sensor, and draws of those that are not drawn where they are made.
"""
