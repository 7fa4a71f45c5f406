"""What people and other systems outside see of the station, and ask of it: a process apart from the controller."""
