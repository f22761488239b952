"""What generate.py is made of, and what is asked of a finished dataset: shards, storage, verify."""
