"""The command of a log: rebuilt from its signals, or noted by the operator."""
