"""Pictures of the state machine, simulations and sweeps."""
