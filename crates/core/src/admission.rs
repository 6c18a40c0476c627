//! Checks of an offered plan before it is accepted (safety.md, section 2.4).
