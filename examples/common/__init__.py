"""What the examples share: data rendered once, a training loop, a detector, metrics and charts."""
