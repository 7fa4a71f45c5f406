"""What a policy would do, in hours of simulated time."""
