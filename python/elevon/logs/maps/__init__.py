"""From columns to signals: what each column of a log is, and its factor to SI."""
