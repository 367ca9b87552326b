"""Files of instance masks: one module a format."""
