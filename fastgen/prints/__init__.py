"""What prints are made of, below markings.py: identifiers, figures, lettering, artwork."""
