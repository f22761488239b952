"""What scenes are drawn from, below config.py and sampling.py: ranges and draws of damages,
prints and the sensor, and all of it as text.
"""
