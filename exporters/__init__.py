"""Writers of models, one module per format, and the table of formats.

A format is a module here with a constant `FORMAT` (see
`fuzzytree.model.contracts.Format`) and a line in `TABLE`; `docs/how-to/add-a-format.md`
shows how to add one. Third-party packages offer theirs by the entry point group
`fuzzytree.formats`. A module is imported when its format is used, and a third-party
package only for a format that this table lacks.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
