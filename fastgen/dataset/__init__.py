"""What generate.py is made of, and what a finished dataset is asked: shards, verify, stats."""
