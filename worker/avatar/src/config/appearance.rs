//! The representation in canonical space: a field that rays march through, or splats.

use super::{CanonicalConfig, FieldConfig, MarchConfig, ModelConfig, SplatConfig};
use serde::{Deserialize, Serialize};

/// Foreground likelihood at the border of the canonical box of people of splats, as [`MarchConfig::epsilon`] is of
/// others. Checkpoints depend on it.
const BOX_EPSILON: f32 = 1e-3;

/// The representation in canonical space.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parts", into = "Parts")]
pub enum Appearance {
    /// A field that rays march through.
    Field(FieldConfig),
    /// Splats on the body's surface.
    Splats(SplatConfig),
}

impl Appearance {
    /// The field's settings, for an experiment that changes them; `None` for other representations.
    pub fn field_mut(&mut self) -> Option<&mut FieldConfig> {
        match self {
            Self::Field(field) => Some(field),
            Self::Splats(_) => None,
        }
    }

    /// The settings of splats, for an experiment that changes them; `None` for other representations.
    pub fn splats_mut(&mut self) -> Option<&mut SplatConfig> {
        match self {
            Self::Field(_) => None,
            Self::Splats(splats) => Some(splats),
        }
    }
}

impl ModelConfig {
    /// Foreground likelihood of the prior at the border of a person's canonical box.
    pub(crate) fn box_epsilon(&self) -> f32 {
        match &self.appearance {
            Appearance::Field(field) => field.march.epsilon,
            Appearance::Splats(_) => BOX_EPSILON,
        }
    }
}

/// The JSON of an [`Appearance`]: `canonical` and `march`, or `splats`. Earlier versions wrote all three for
/// splats, which used only the size of the box from the first two.
#[derive(Serialize, Deserialize)]
struct Parts {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    canonical: Option<CanonicalConfig>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    splats: Option<SplatConfig>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    march: Option<MarchConfig>,
}

impl From<Appearance> for Parts {
    fn from(appearance: Appearance) -> Self {
        match appearance {
            Appearance::Field(FieldConfig { canonical, march }) => Self {
                canonical: Some(canonical),
                splats: None,
                march: Some(march),
            },
            Appearance::Splats(splats) => Self {
                canonical: None,
                splats: Some(splats),
                march: None,
            },
        }
    }
}

impl TryFrom<Parts> for Appearance {
    type Error = String;

    fn try_from(parts: Parts) -> Result<Self, Self::Error> {
        match parts {
            Parts {
                splats: Some(splats),
                march,
                ..
            } => match march {
                Some(march) if march.epsilon != BOX_EPSILON => Err(format!(
                    "march.epsilon: {}, but boxes of people of splats are made for {BOX_EPSILON}",
                    march.epsilon
                )),
                _ => Ok(Self::Splats(splats)),
            },
            Parts {
                canonical: Some(canonical),
                march: Some(march),
                ..
            } => Ok(Self::Field(FieldConfig { canonical, march })),
            _ => Err("either splats are needed, or canonical and march".into()),
        }
    }
}
