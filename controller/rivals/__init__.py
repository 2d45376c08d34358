"""Controllers of other papers (`clf-qp`, `output-mpc`), to be compared with the cascades under equal conditions."""
