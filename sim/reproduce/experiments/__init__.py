"""One module a figure, table or claim of the paper."""
