"""Solving of scenes: histories, responses, advice, and histories read from files."""
