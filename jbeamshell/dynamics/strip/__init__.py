"""Dynamics of one strip: inertia, excitation, natural modes, time integration."""
