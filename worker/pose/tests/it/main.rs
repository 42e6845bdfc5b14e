//! Poses from key points of made-up people.

mod fit;
mod flips;
mod people;
