"""Device drivers, one charger or battery each: poll, command and read back, with deadlines; frames become readings."""
