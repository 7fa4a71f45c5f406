"""`orchestrator demo`: an emulated bay with the unchanged service, shown until it ends by itself."""
