"""Quasi-static load paths: one residual, Newton's method, one scan over the steps."""
