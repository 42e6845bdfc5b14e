//! Single settings of a configuration, by the names that its JSON has: how an experiment says
//! what it changes, `march.epsilon=1e-3`.

use super::{ConfigError, ModelConfig};
use serde_json::Value;
use std::fmt;
use std::str::FromStr;

/// One setting and the value it shall have.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Names from the outside in.
    path: Vec<String>,
    value: Value,
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.path.join("."), self.value)
    }
}

impl FromStr for Setting {
    type Err = String;

    /// Of `NAME.NAME=VALUE`. What is no JSON is a word.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (path, value) = text
            .split_once('=')
            .ok_or_else(|| format!("'{text}' is not NAME.NAME=VALUE"))?;
        Ok(Self {
            path: path.split('.').map(str::to_owned).collect(),
            value: serde_json::from_str(value).unwrap_or_else(|_| value.into()),
        })
    }
}

impl ModelConfig {
    /// The same with other values of some settings.
    ///
    /// # Errors
    /// When there is no such setting, or no model can be made with its value.
    pub fn with(self, settings: &[Setting]) -> Result<Self, ConfigError> {
        if settings.is_empty() {
            return Ok(self);
        }
        let named = |message: String| ConfigError::Field {
            field: "settings",
            message,
        };
        let mut all = serde_json::to_value(self).map_err(|e| named(e.to_string()))?;
        for setting in settings {
            let mut place = &mut all;
            for name in &setting.path {
                let names = place.as_object().map(|object| {
                    let names: Vec<_> = object.keys().map(String::as_str).collect();
                    names.join(", ")
                });
                place = place.get_mut(name).ok_or_else(|| {
                    let names = names.unwrap_or_else(|| "nothing".into());
                    named(format!("{setting}: no '{name}' here, but {names}"))
                })?;
            }
            *place = setting.value.clone();
            // Said of the setting whose value it is, not of all of them.
            serde_json::from_value::<Self>(all.clone())
                .map_err(|e| named(format!("{setting}: {e}")))?;
        }
        let config: Self = serde_json::from_value(all).map_err(|e| named(e.to_string()))?;
        config.check()?;
        Ok(config)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fast() -> ModelConfig {
        ModelConfig::named("fast", "yoto").expect("a tier")
    }

    fn with(text: &str) -> Result<ModelConfig, ConfigError> {
        fast().with(&[text.parse().expect("a setting")])
    }

    #[test]
    fn numbers_and_words_are_set_by_name() {
        let config = with("march.epsilon=0.25").expect("there");
        assert_eq!(config.march.epsilon, 0.25);
        let config = with("precision=bf16").expect("there");
        assert_eq!(config.precision, crate::config::Precision::Bf16);
        assert_eq!(fast().with(&[]).expect("nothing asked"), fast());
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, said) in [
            ("march.epsilom=1", "min_transmittance"),
            ("march.epsilon.x=1", "nothing"),
            ("march.epsilon=much", "much"),
            ("march.epsilon=1.5", "march"),
        ] {
            let error = with(text).expect_err(text).to_string();
            assert!(error.contains(said), "{text}: {error}");
        }
        assert!("march.epsilon".parse::<Setting>().is_err());
    }
}
