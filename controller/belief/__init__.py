"""What the controller believes of the walker: its model, its gait, which leg stands, what contact may bear."""
