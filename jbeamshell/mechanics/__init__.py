"""Mechanics of one point, one section and one element, each written once as a scalar function."""
