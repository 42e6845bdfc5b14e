//! The person that each step learns from.

use serde::{Deserialize, Serialize};

/// How a step chooses its person and frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SamplingStrategy {
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
    /// How a step chooses its person and frame. Configurations call it `turns`.
    #[serde(rename = "turns")]
    pub strategy: SamplingStrategy,
}

impl SamplingConfig {
    /// Equal shares for everybody.
    pub const FAIR: Self = Self {
        strategy: SamplingStrategy::Person,
    };
}
