//! Proof of the expansion against closed forms, slow textbook code and published figures.
