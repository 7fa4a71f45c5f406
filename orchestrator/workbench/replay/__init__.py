"""What was decided, decided again."""
