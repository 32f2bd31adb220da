"""Parts of speed.py: what a cycle of the standard strip costs, and how wrong it is at that price.

Errors are relative and of the dissipation: ``error`` against the same model on a fine grid (FINE),
``error_to_elements`` against fine plane finite elements (calibration/data/energy.csv).
"""
