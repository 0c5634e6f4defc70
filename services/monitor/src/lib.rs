//! Lossy taps for people: the running chain in a terminal and as a live view.
