"""Tactile sensors: from a serial port to the objects that lie on a matrix of cells.

```python
import fuzzytree as ft

with ft.tactile.open("/dev/ttyUSB0", board="mat.yaml", model="objects.yaml") as sensor:
    for frame in sensor:
        for thing in frame.objects:
            print(f"{frame.time:.2f} {thing.label} {thing.strength:.2f} {thing.box}")
```
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
