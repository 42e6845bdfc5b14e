//! Poses from key points of synthetic people.

mod fit;
mod flips;
mod floor;
mod people;
mod wrists;
