"""Exact solutions from the literature, each with its source."""
