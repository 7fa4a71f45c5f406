"""Battery and charger models, and emulated devices on a real tty and a real CAN bus."""
