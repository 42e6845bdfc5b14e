//! Number of nodes of a grid over the canonical box.

use serde::{Deserialize, Serialize};

/// Nodes of a grid along x, y and z. A body in the rest pose is wide and tall but not deep, so that
/// equal numbers along all axes, as in HumanNeRF, make cells three times as wide as deep.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Resolution {
    /// The same number along each axis.
    Cube(usize),
    /// One number per axis.
    Axes([usize; 3]),
}

impl Resolution {
    /// Nodes along x, y and z.
    pub fn nodes(self) -> [usize; 3] {
        match self {
            Self::Cube(side) => [side; 3],
            Self::Axes(nodes) => nodes,
        }
    }

    /// Number of nodes.
    pub fn voxels(self) -> usize {
        self.nodes().iter().product()
    }
}

impl From<usize> for Resolution {
    fn from(side: usize) -> Self {
        Self::Cube(side)
    }
}
