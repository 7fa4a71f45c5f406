"""Before a bay charges for the first time: its devices asked, its object map found."""
