"""What a log holds: fields, units, schemas."""
