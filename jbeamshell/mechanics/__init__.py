"""Laws of one point, one section or one element, each written once as a scalar function."""
