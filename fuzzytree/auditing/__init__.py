"""What is odd in a rule base: one module for each family of questions."""
