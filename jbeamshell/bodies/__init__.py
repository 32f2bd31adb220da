"""Contact of elastic bodies of any origin, condensed to the nodes of their contact."""
