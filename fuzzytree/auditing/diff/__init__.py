"""What changed between two models, and where they decide differently.

In reading order:

- `records`: a change, its grade, and the whole difference
- `keys`: what curves, conditions and outputs mean, as values that can be compared
- `matching`: which rule, term or variable corresponds to which, by content
- `structure`: the changes of rules, classes, variables and terms
- `samples`: two models side by side, and the rows on which they are compared
- `agreement`, `regions`: do two models decide alike everywhere; a box where they differ
- `decisions`: where two rule bases decide differently
- `numbers`: how far the outputs of two systems are apart
- `differences`: all of it, for two models
"""
