"""Harmonic balance of structures with joints: forced responses and nonlinear modes."""
