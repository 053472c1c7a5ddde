"""What a log is worth, before anyone identifies anything from it."""
