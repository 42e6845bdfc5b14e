//! The normalisation of a picture's levels for a network.

/// The range to which the levels 0 to 255 of red, green and blue are mapped.
///
/// A network's file does not declare it; its documentation does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Levels {
    /// 0 to 1: RVM.
    Unit,
    /// -1 to 1: MODNet.
    Signed,
    /// -0.5 to 0.5: IS-Net, RMBG 1.4.
    Centred,
    /// ImageNet's mean subtracted, then divided by its standard deviation: U²-Net, BiRefNet, RMBG 2.0.
    ImageNet,
}

/// Mean and standard deviation of the colours of ImageNet's pictures, by torchvision.
const MEAN: [f32; 3] = [0.485, 0.456, 0.406];
const DEVIATION: [f32; 3] = [0.229, 0.224, 0.225];

impl Levels {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Unit, Self::Signed, Self::Centred, Self::ImageNet];

    /// Its name in options.
    pub fn name(self) -> &'static str {
        match self {
            Self::Unit => "unit",
            Self::Signed => "signed",
            Self::Centred => "centred",
            Self::ImageNet => "imagenet",
        }
    }

    /// The normalised value of a level of channel 0, 1 or 2.
    pub(crate) fn of(self, level: u8, channel: usize) -> f32 {
        let unit = f32::from(level) / 255.0;
        match self {
            Self::Unit => unit,
            Self::Signed => 2.0 * unit - 1.0,
            Self::Centred => unit - 0.5,
            Self::ImageNet => (unit - MEAN[channel]) / DEVIATION[channel],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_those_that_networks_were_trained_with() {
        let ends = |levels: Levels| [levels.of(0, 1), levels.of(255, 1)];
        assert_eq!(ends(Levels::Unit), [0.0, 1.0]);
        assert_eq!(ends(Levels::Signed), [-1.0, 1.0]);
        assert_eq!(ends(Levels::Centred), [-0.5, 0.5]);
        let [low, high] = ends(Levels::ImageNet);
        assert!((low + 0.456 / 0.224).abs() < 1e-6 && (high - 0.544 / 0.224).abs() < 1e-6);
    }
}
