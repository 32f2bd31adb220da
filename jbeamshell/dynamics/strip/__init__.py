"""The strip in motion: inertia, excitation, time integration, natural modes."""
