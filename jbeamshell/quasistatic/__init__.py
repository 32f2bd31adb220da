"""Load paths solved step by step: one residual, Newton's method, one scan over the path."""
