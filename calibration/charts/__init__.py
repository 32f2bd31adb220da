"""Charts of the recorded benchmarks and studies."""
