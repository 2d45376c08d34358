"""The plant's world: MuJoCo, contact, pushes, errors, time and logs."""
