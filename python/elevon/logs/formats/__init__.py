"""Files as tables of columns: every format a log may come in."""
