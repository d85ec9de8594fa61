"""What can execute a model, one module per runtime family, and their table.

A runtime is a value in the tuple `RUNTIMES` of its module (see
`fuzzytree.model.contracts.Runtime`), and the module a line in `TABLE`. These modules
import what they run on only inside `load`, so the table can be read without it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
