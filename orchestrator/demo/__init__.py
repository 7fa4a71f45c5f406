"""`orchestrator demo`: an emulated bay, the unchanged service on it, and a look at both until it ends by itself."""
