"""Measurements."""

CASES = ()
