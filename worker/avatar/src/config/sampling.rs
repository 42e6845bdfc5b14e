//! The person that each step learns from.

use serde::{Deserialize, Serialize};

/// The order of people.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Turns {
    /// Every frame of everybody once per epoch, as in HumanNeRF's data loader: a longer film gets more steps.
    #[default]
    Frame,
    /// Everybody once per round, each with the next of their own frames: a short film gets the same number of
    /// steps as a long one.
    Person,
}

/// The person that each step learns from (docs/use/people.md).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct SamplingConfig {
    /// The order of people.
    pub turns: Turns,
}

impl SamplingConfig {
    /// Equal shares for everybody.
    pub const FAIR: Self = Self {
        turns: Turns::Person,
    };
}
