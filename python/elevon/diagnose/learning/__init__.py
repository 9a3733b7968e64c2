"""What diagnosis learns from one's own logs: spread of healthy days, labelled classes."""
