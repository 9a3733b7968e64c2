"""The virtual bench: its rig, its procedures, the parts it is made of, and the logs it writes."""
