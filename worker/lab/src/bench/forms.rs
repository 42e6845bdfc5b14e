//! Three forms of the paper's step, from all samples to a form for CPUs, for like-for-like
//! comparisons with other programs.

use std::fmt;
use std::str::FromStr;
use yoto_avatar::config::{ConfigError, ModelConfig, Setting};

/// The computed part of the paper's step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepForm {
    /// All samples that matter in f32, all gradients: the released program, the tier `paper`.
    Exact,
    /// Samples under a foreground likelihood of 1e-3 left out, all gradients of the others, as
    /// in a tuned form of the released program.
    Tuned,
    /// The tier `paper-lean`.
    Lean,
}

impl StepForm {
    /// All forms, most expensive first.
    pub const ALL: [Self; 3] = [Self::Exact, Self::Tuned, Self::Lean];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Tuned => "tuned",
            Self::Lean => "lean",
        }
    }

    /// Description for tables.
    pub fn about(self) -> &'static str {
        match self {
            Self::Exact => "all samples, all gradients",
            Self::Tuned => "likelihoods from 1e-3, all gradients",
            Self::Lean => "as the tier paper-lean",
        }
    }

    /// Its tier.
    pub fn tier(self) -> &'static str {
        match self {
            Self::Exact | Self::Tuned => "paper",
            Self::Lean => "paper-lean",
        }
    }

    /// The configuration of the tier, with `settings` applied.
    ///
    /// # Errors
    /// When a setting does not exist or has an invalid value.
    pub fn config(self, settings: &[Setting]) -> Result<ModelConfig, ConfigError> {
        let mut config = ModelConfig::named(self.tier(), "yoto")?;
        if let (Self::Tuned, Some(march)) = (self, config.appearance.march_mut()) {
            march.epsilon = 1e-3;
        }
        config.with(settings)
    }
}

impl fmt::Display for StepForm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for StepForm {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let named = Self::ALL.into_iter().find(|form| form.name() == text);
        named.ok_or_else(|| format!("'{text}' is not one of: exact, tuned, lean"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forms_leave_out_what_they_say() {
        let config = |form: StepForm| form.config(&[]).expect("a configuration");
        let march = |config: &ModelConfig| config.appearance.march().expect("rays").clone();
        let exact = config(StepForm::Exact);
        assert_eq!(
            (
                exact.optimise.backward_share,
                march(&exact).min_transmittance
            ),
            (1.0, 0.0)
        );
        assert!(march(&exact).epsilon < 1e-7 && march(&exact).occupancy_cells == 0);
        let tuned = config(StepForm::Tuned);
        assert_eq!(
            (tuned.optimise.backward_share, march(&tuned).epsilon),
            (1.0, 1e-3)
        );
        assert_eq!(config(StepForm::Lean).tier, "paper-lean");
        for form in StepForm::ALL {
            assert_eq!(form.name().parse(), Ok(form));
        }
        assert!("all".parse::<StepForm>().is_err());
    }
}
