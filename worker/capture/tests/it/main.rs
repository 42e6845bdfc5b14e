//! The check of a capture, on synthetic people.

mod check;
