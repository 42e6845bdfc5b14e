//! The light of a video's levels, declared or chosen by the user.

use super::signal::Signal;

/// The light of a video's levels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Hdr {
    /// The declared light, unless the first picture shows that it is wrong.
    #[default]
    Auto,
    /// Ordinary video, whatever is declared.
    Off,
    /// HLG.
    Hlg,
    /// PQ.
    Pq,
}

/// H.273's numbers: BT.709 for primaries and transfer, BT.2020's and Display P3's primaries, PQ, HLG.
const BT709: u64 = 1;
const BT2020: u64 = 9;
const DISPLAY_P3: u64 = 12;
const PQ: u64 = 16;
const HLG: u64 = 18;

impl Hdr {
    /// The signal of the video's levels, given its declaration. HLG and PQ have BT.2020's primaries unless wide ones are declared.
    pub(super) fn of(self, declared: Signal) -> Signal {
        let wide = match declared.primaries {
            DISPLAY_P3 => DISPLAY_P3,
            _ => BT2020,
        };
        let (primaries, transfer) = match self {
            Self::Auto => return declared,
            Self::Off => (BT709, BT709),
            Self::Hlg => (wide, HLG),
            Self::Pq => (wide, PQ),
        };
        Signal {
            primaries,
            transfer,
            ..declared
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_is_as_declared_or_as_said() {
        let light = |hdr: Hdr, primaries, transfer| {
            let declared = Signal {
                primaries,
                transfer,
                ..Signal::UNSPECIFIED
            };
            hdr.of(declared).light().map(|light| light.to_string())
        };
        let declared = light(Hdr::Auto, BT2020, HLG);
        assert_eq!(declared, light(Hdr::Hlg, BT709, BT709));
        assert!(declared.is_some_and(|it| it.contains("HLG")));
        assert_eq!(light(Hdr::Off, BT2020, HLG), None);
        assert_eq!(light(Hdr::Auto, BT709, BT709), None);
        let narrow = light(Hdr::Pq, DISPLAY_P3, BT709);
        assert!(narrow.is_some_and(|it| it.contains("PQ") && it.contains("P3")));
    }
}
