"""Tools without physics: errors, checks of input, files, options of JAX."""
