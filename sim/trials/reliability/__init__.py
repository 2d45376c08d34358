"""The nearest fall, the probability of a fall, and what it is made of: yes/no answers in standard normal space."""
