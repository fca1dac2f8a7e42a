"""What an analysis stands on: `works` lists what there is, `used` says what was used, `bibtex` writes it down."""
