"""The record of charges: what each one took, why it paused and why it ended, for as long as the station keeps it."""
