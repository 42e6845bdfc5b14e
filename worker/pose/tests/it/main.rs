//! Poses from key points of synthetic people.

mod fit;
mod flips;
mod people;
mod wrists;
