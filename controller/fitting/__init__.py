"""Any law, following a gait of the library that fits the moment."""
