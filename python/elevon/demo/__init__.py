"""The demonstration: a unit lives, is inspected, diagnosed, and its end is predicted."""
