"""Scene: strip, contact, load and model, with keys, TOML files and the scenes that ship."""
