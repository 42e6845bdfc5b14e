//! Single settings of a configuration by their names in its JSON, such as `march.epsilon=1e-3`:
//! the changes that an experiment makes.

use super::{ConfigError, ModelConfig};
use serde_json::Value;
use std::fmt;
use std::str::FromStr;

/// One setting and its new value.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Names from the outermost object inwards.
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

    /// Parses `NAME.NAME=VALUE`. A value that is not JSON is taken as a string.
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
    /// This configuration with `settings` replaced.
    ///
    /// # Errors
    /// If there is no such setting or its value is invalid.
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
            let mut value = &mut all;
            for name in &setting.path {
                let names = value.as_object().map(|object| {
                    let names: Vec<_> = object.keys().map(String::as_str).collect();
                    names.join(", ")
                });
                value = value.get_mut(name).ok_or_else(|| {
                    let names = names.unwrap_or_else(|| "nothing".into());
                    named(format!("{setting}: no '{name}' here, but {names}"))
                })?;
            }
            *value = setting.value.clone();
            // Checked after each setting, so that the error names the right one.
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
        assert_eq!(config.appearance.march().expect("rays").epsilon, 0.25);
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
