//! The turn that `--turn-points` undoes.

/// By how much the pictures that a detector saw were turned clockwise, degrees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum PointTurn {
    /// A quarter turn clockwise.
    #[value(name = "90")]
    Quarter,
    /// A half turn.
    #[value(name = "180")]
    Half,
    /// A quarter turn counter-clockwise.
    #[value(name = "270")]
    ThreeQuarters,
}

impl PointTurn {
    /// 90, 180 or 270.
    pub(super) fn degrees(self) -> u32 {
        match self {
            Self::Quarter => 90,
            Self::Half => 180,
            Self::ThreeQuarters => 270,
        }
    }
}
