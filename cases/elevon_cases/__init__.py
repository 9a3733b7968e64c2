"""Published tables and figures, recomputed: each module returns rows and checks."""
