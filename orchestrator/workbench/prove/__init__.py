"""What a policy can never do, and what it can hardly mean."""
