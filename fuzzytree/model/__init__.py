"""Values: variables, membership functions, rules, trees, systems and their records."""
