"""The paper's claims about its own tree, measured: what `claims.py` is made of."""
