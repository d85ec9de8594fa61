"""Reports about frames: text, pages and figures."""
