//! The rotation of pictures that `--turn-points` undoes.

/// The clockwise rotation of the pictures that a detector saw, degrees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum PointRotation {
    /// 90 degrees clockwise.
    #[value(name = "90")]
    Quarter,
    /// 180 degrees.
    #[value(name = "180")]
    Half,
    /// 90 degrees counter-clockwise.
    #[value(name = "270")]
    ThreeQuarters,
}

impl PointRotation {
    /// 90, 180 or 270.
    pub(super) fn degrees(self) -> u32 {
        match self {
            Self::Quarter => 90,
            Self::Half => 180,
            Self::ThreeQuarters => 270,
        }
    }
}
