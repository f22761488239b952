"""What labels.py is made of: outlines, visibility, damage. And what is made of labels: text crops,
boxes over images.
"""
