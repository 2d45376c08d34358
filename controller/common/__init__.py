"""Common ground of both worlds: records, settings and errors they share, and how kernels are compiled."""
