"""The artifact comparison: shares, exact tests, equivalence."""
