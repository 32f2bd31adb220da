"""History of a load path: fields, figures of the last cycle, reliability, reports."""
