//! Units of lengths in files.

use serde::{Deserialize, Serialize};

/// A unit of length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Unit {
    /// The unit of the pose track's schema.
    #[default]
    #[serde(rename = "m")]
    Metre,
    /// A hundredth of a metre.
    #[serde(rename = "cm")]
    Centimetre,
    /// A thousandth of a metre.
    #[serde(rename = "mm")]
    Millimetre,
}

impl Unit {
    /// Metres per unit.
    pub fn metres(self) -> f64 {
        match self {
            Self::Metre => 1.0,
            Self::Centimetre => 0.01,
            Self::Millimetre => 0.001,
        }
    }

    /// `m`, `cm` or `mm`.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Metre => "m",
            Self::Centimetre => "cm",
            Self::Millimetre => "mm",
        }
    }
}

/// Unit of each kind of length, since files mix units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Units {
    /// The translation in each frame's extrinsics.
    pub camera: Unit,
    /// Each frame's root translation.
    pub root: Unit,
    /// The rest joints.
    pub skeleton: Unit,
}

impl Units {
    /// One unit for all lengths.
    pub fn all(unit: Unit) -> Self {
        Self {
            camera: unit,
            root: unit,
            skeleton: unit,
        }
    }
}
