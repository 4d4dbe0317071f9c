"""What a run leaves behind: figures, recordings and tables."""
