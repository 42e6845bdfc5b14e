//! From whom each step learns.

use super::ConfigError;
use serde::{Deserialize, Serialize};

/// Whose turn it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Turns {
    /// Every frame of everybody once per epoch, as in HumanNeRF's data loader: a longer film gets more steps.
    #[default]
    Frame,
    /// Everybody once per round, each with the next of their own frames: as many steps for a short film as
    /// for a long one.
    Person,
}

/// From whom each step learns (docs/people.md has the experiments).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SamplingConfig {
    /// Whose turn it is.
    pub turns: Turns,
    /// Exponent of a person's loss in the share of steps that they get, with turns of people; 0: equal
    /// shares.
    pub harder: f64,
}

impl SamplingConfig {
    /// Equal shares for everybody.
    pub const FAIR: Self = Self {
        turns: Turns::Person,
        harder: 0.0,
    };

    /// Checks every field.
    ///
    /// # Errors
    /// The first one that is out of its range.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        let wrong = |message: &str| {
            Err(ConfigError::Field {
                field: "sampling.harder",
                message: message.into(),
            })
        };
        if !(0.0..=4.0).contains(&self.harder) {
            return wrong("must be between 0 and 4");
        }
        if self.harder > 0.0 && self.turns == Turns::Frame {
            return wrong("needs sampling.turns=person");
        }
        Ok(())
    }
}
