"""`underlay app`: the browser page. It computes nothing itself: it calls the same functions as the commands."""
