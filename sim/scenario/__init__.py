"""What happens in a run, and its TOML files."""
