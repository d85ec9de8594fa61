"""What a model needs of its inputs, terms and operators, and what leaving out saves."""
