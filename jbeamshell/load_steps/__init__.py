"""Load steps: one residual, Newton's method, one scan over the steps."""
