"""The one place where both worlds meet."""
