"""The command line: one module per verb, loaded when its verb is used.

Data goes to stdout, messages go to stderr. Exit codes: 0 fine; 1 it ran and found
something; 2 it could not run; 130 interrupted; 141 the reader of the output is gone.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
