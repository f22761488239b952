"""Labels: Frame + Scene -> Objects, text crops and overlays."""
