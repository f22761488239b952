"""Generation of datasets by many processes, their storage, verification, repair and statistics."""
