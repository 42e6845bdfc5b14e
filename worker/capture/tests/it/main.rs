//! What the check of a capture says of made-up people.

mod check;
