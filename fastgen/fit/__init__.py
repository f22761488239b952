"""Configurations that make rendered pictures resemble a user's photographs."""
