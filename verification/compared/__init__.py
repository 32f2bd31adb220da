"""Ways to solve a strip that `verification.methods` compares with those of the library."""
