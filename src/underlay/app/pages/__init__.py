"""The page that the browser shows, step by step."""
