"""What labels.py is made of: outlines, visibility, damage, text crops; and boxes over images."""
