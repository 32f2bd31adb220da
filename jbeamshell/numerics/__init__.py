"""Numerics without physics: block-tridiagonal elimination, Newton's method, closed cycles."""
