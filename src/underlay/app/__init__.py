"""`underlay app`: the browser page. It computes nothing itself: it calls what the command line calls."""
