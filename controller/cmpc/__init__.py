"""The paper's controller: ZD+PD, the partial prediction, and the MPC around them."""
