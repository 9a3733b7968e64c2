"""The Torino bench as the works use it: no-load validation, loaded campaign, dropped weights."""
