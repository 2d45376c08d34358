"""Why a walker fell."""
