"""Floor 1: pure contact mechanics. numpy and scipy only; no data, no files, no fitting."""
