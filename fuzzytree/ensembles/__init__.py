"""Tree ensembles of other libraries, and whether two of them are the same function."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
