"""Settings as trees of frozen dataclasses: units, checks, TOML and flags; it knows no scenario."""
