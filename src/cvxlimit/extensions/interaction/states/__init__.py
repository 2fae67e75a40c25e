"""States of one contact with interaction: what is admissible, from outside and from inside."""
