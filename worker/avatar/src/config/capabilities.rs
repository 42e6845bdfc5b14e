//! Capabilities of the representations in canonical space. Code asks for a capability, not for the representation, so that a further
//! one answers here, once, and the compiler names every other place that has to know it.

use super::{Appearance, Encoding, MarchConfig, PoseShapesConfig};

/// Capabilities of a representation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Capabilities {
    /// People can be lit otherwise than in their captures.
    pub light: bool,
    /// Frames can show fewer primitives, where poses move them by bones alone.
    pub levels_of_detail: bool,
    /// Frames take milliseconds, not seconds, so that fits and validations can compare many.
    pub fast_frames: bool,
    /// Frames can have the numerics of the released HumanNeRF program.
    pub reference_numerics: bool,
    /// The mean of two people's parameters is a person between them. Otherwise both are drawn.
    pub interpolated_parameters: bool,
    /// An earlier state can replace a later one. It can't where parts take part by the progress of the run.
    pub restorable: bool,
}

const FIELD: Capabilities = Capabilities {
    light: false,
    levels_of_detail: false,
    fast_frames: false,
    reference_numerics: true,
    interpolated_parameters: true,
    restorable: false,
};

const SPLATS: Capabilities = Capabilities {
    light: true,
    levels_of_detail: true,
    fast_frames: true,
    reference_numerics: false,
    interpolated_parameters: false,
    restorable: true,
};

impl Appearance {
    /// The capabilities of the representation.
    pub fn capabilities(&self) -> Capabilities {
        match self {
            Self::Field(_) => FIELD,
            Self::Splats(_) => SPLATS,
        }
    }

    /// Settings of the march of rays; `None` if frames have no rays.
    pub fn march(&self) -> Option<&MarchConfig> {
        match self {
            Self::Field(field) => Some(&field.march),
            Self::Splats(_) => None,
        }
    }

    /// Settings of the march of rays, to change them; `None` if frames have no rays.
    pub fn march_mut(&mut self) -> Option<&mut MarchConfig> {
        match self {
            Self::Field(field) => Some(&mut field.march),
            Self::Splats(_) => None,
        }
    }

    /// The encoding of canonical points; `None` if no network sees them.
    pub fn encoding(&self) -> Option<&Encoding> {
        match self {
            Self::Field(field) => Some(&field.canonical.encoding),
            Self::Splats(_) => None,
        }
    }

    /// Pose blend shapes; `None` if nothing can be moved by them.
    pub(crate) fn pose_shapes(&self) -> Option<&PoseShapesConfig> {
        match self {
            Self::Field(_) => None,
            Self::Splats(splats) => Some(&splats.pose_shapes),
        }
    }

    /// Whether the colours of surface that no training frame shows are guessed.
    pub(crate) fn guesses_unseen(&self) -> bool {
        match self {
            Self::Field(_) => false,
            Self::Splats(splats) => splats.guess_unseen,
        }
    }
}
