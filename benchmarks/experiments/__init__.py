"""What is measured: a function prints tables, and one or more records keep what it printed."""
