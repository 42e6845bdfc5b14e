//! Parity: values and gradients of each part of the model, and of one complete training step,
//! against the double-precision reference in `tests/reference`. `docs/research/parity.md` has the table that
//! `cargo test -p yoto-avatar --test it parity:: -- --nocapture` prints.

mod case;
mod check;
mod fields;
mod kinematics;
mod motion;
mod optimise;
mod rendering;
mod small;
mod step;
