"""Why a model decides one row as it does, and what would change it.

- `records`: an explanation and its parts
- `rows`: a model of any kind
- `classes`: the winning rule, the next one, and the smallest change of the inputs
- `outputs`: the rules of a system that fire, and how its outputs change
"""
