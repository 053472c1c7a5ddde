"""What every room may use: errors, words, files, numbers. It imports no other room."""
