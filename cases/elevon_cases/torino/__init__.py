"""The Torino bench: no-load and loaded campaigns, weight drops, compliance, gear, failure modes."""
