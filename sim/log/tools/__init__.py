"""cmpc log: info, check, recover, compare, export."""
