"""The sub-commands of `cmpc`, one module each with `main(argv) -> int`."""
