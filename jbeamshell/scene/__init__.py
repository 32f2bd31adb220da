"""The scene: strip, contact, load and model, its keys, its TOML files and the scenes that ship."""
