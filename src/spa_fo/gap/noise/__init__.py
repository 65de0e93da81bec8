"""What no law explains: coloured noise, scatter of trials, the fixture's error, interference."""
