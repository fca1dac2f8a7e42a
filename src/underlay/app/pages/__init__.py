"""The page, step by step."""
