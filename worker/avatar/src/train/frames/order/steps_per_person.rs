//! The steps with one person, of which checkpoints keep the number.

use serde::{Deserialize, Serialize};

/// The steps with one person.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PersonSteps {
    /// Their number, over the model's life.
    pub steps: u64,
}
