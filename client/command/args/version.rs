//! A checkpoint of a model, by its step or by the name that somebody gave it.

use std::str::FromStr;
use yoto_proto::alias;

/// `2000` or `prod`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Version(String);

impl FromStr for Version {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let is_step = text
            .parse::<u64>()
            .is_ok_and(|step| step.to_string() == text);
        match is_step || alias::is_alias(text) {
            true => Ok(Self(text.to_owned())),
            false => Err(format!(
                "`{text}` is neither a step nor an alias: {}",
                alias::RULE
            )),
        }
    }
}

impl Version {
    /// The resource name of the checkpoint of `model`, `models/{id}`.
    pub(crate) fn of(&self, model: &str) -> String {
        format!("{model}/checkpoints/{}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_version_is_a_step_or_an_alias() {
        let of = |text: &str| text.parse::<Version>().map(|it| it.of("models/m"));
        assert_eq!(of("2000").as_deref(), Ok("models/m/checkpoints/2000"));
        assert_eq!(of("prod").as_deref(), Ok("models/m/checkpoints/prod"));
        for bad in ["02", "+2", "Prod", "a/b", ""] {
            assert!(of(bad).is_err(), "{bad}");
        }
    }
}
