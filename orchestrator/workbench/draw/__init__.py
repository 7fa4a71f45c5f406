"""Pictures: the state machine, simulations, sweeps."""
