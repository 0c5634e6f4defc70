//! A recording as one self-contained web page.
