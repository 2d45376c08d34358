"""What a campaign found: statistics, plots, pages."""
