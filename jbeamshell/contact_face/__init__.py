"""Contact of bodies on a face: pairs of nodes in three dimensions, in backward load steps."""
