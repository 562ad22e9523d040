"""What a world looks like, as plain arrays; no drawing library is imported."""
