"""Structures with strips as joints: matrices, modal analysis, transients."""
