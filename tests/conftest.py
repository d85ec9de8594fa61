"""What must be set before any library is imported."""

import os

# scikit-learn leaves checks of its estimators out without it.
os.environ.setdefault("SCIPY_ARRAY_API", "1")
