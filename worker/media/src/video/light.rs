//! High dynamic range and wide gamut to ordinary video: the numbers that training, masks and detectors expect.
//!
//! Display light of ITU-R BT.2100 is divided by the reference white of BT.2408, 203 cd/m², so that a white wall or a white shirt is
//! white; its colours are brought to BT.709's primaries; and light above [`KNEE`] is compressed, so that
//! 1000 cd/m² are the brightest level. The result is coded with BT.1886's exponent, by which displays show ordinary video. So a film
//! that was converted to HLG or PQ at reference white comes back as it was, but for its brightest levels.

use std::fmt;

/// Light of diffuse white, cd/m² (BT.2408, table 1).
const WHITE: f32 = 203.0;
/// Light of the brightest level, cd/m²: BT.2100's nominal peak of HLG, and the usual one of PQ.
const PEAK: f32 = 1000.0;
/// Share of white up to which light stays as it is.
const KNEE: f32 = 0.85;
/// Exponent of displays of ordinary video (BT.1886).
const GAMMA: f32 = 2.4;
/// Entries of tables over levels of 16 bits.
const LEVELS: usize = 1 << 16;
/// Entries of tables over light, by its square root.
const STEPS: usize = 1 << 12;

/// The transfer function from light to levels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Transfer {
    /// The levels of ordinary video.
    Sdr,
    /// Hybrid log-gamma (BT.2100).
    Hlg,
    /// Perceptual quantiser (SMPTE ST 2084).
    Pq,
}

/// The colours of full red, green and blue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Primaries {
    Bt709,
    Bt2020,
    DisplayP3,
}

/// The light that a video's numbers stand for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Light {
    pub(super) transfer: Transfer,
    pub(super) primaries: Primaries,
}

/// RGB of a picture, from 0 to the largest level.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Levels {
    Eight(Vec<u8>),
    Sixteen(Vec<u16>),
}

impl fmt::Display for Light {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let primaries = match self.primaries {
            Primaries::Bt709 => "BT.709",
            Primaries::Bt2020 => "BT.2020",
            Primaries::DisplayP3 => "Display P3",
        };
        match self.transfer {
            Transfer::Sdr => write!(to, "wide gamut ({primaries})"),
            Transfer::Hlg => write!(to, "HDR (HLG, {primaries})"),
            Transfer::Pq => write!(to, "HDR (PQ, {primaries})"),
        }
    }
}

impl Primaries {
    /// The matrix to BT.709's linear RGB.
    fn to_bt709(self) -> [[f32; 3]; 3] {
        match self {
            Self::Bt709 => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            // ITU-R BT.2087, annex 2.
            Self::Bt2020 => [
                [1.660_5, -0.587_6, -0.072_8],
                [-0.124_6, 1.132_9, -0.008_3],
                [-0.018_2, -0.100_6, 1.118_7],
            ],
            // From the primaries of SMPTE EG 432-1 with the white D65.
            Self::DisplayP3 => [
                [1.224_9, -0.224_9, 0.0],
                [-0.042_0, 1.042_0, 0.0],
                [-0.019_6, -0.078_6, 1.098_3],
            ],
        }
    }

    /// Weights of red, green and blue in luminance.
    fn luminance(self) -> [f32; 3] {
        match self {
            Self::Bt709 => [0.2126, 0.7152, 0.0722],
            Self::Bt2020 => [0.2627, 0.6780, 0.0593],
            Self::DisplayP3 => [0.2290, 0.6917, 0.0793],
        }
    }
}

impl Transfer {
    /// Linear light of a level from 0 to 1: shares of diffuse white, but of the peak of the scene with HLG, whose displays
    /// raise it by a power of its luminance.
    fn linear(self, level: f32) -> f32 {
        match self {
            Self::Sdr => level.powf(GAMMA),
            Self::Hlg if level <= 0.5 => level * level / 3.0,
            // BT.2100, table 5: a, b and c of the inverse transfer function.
            Self::Hlg => (((level - 0.559_910_7) / 0.178_832_77).exp() + 0.284_668_92) / 12.0,
            Self::Pq => {
                // BT.2100, table 4: m1, m2, c1, c2, c3.
                let root = level.powf(1.0 / 78.843_75);
                let part = (root - 0.835_937_5).max(0.0) / (18.851_563 - 18.687_5 * root);
                10_000.0 / WHITE * part.powf(1.0 / 0.159_301_76)
            }
        }
    }

    /// The factor from scene to display, in shares of diffuse white, for a scene of luminance `light`.
    fn displayed(self, light: f32) -> f32 {
        match self {
            Self::Sdr | Self::Pq => 1.0,
            // BT.2100, table 5: the exponent 1.2 is that of a display of 1000 cd/m².
            Self::Hlg => PEAK / WHITE * light.max(1e-9).powf(0.2),
        }
    }
}

/// The level of light, both as shares of white: unchanged up to [`KNEE`], then ever flatter up to [`PEAK`].
fn compressed(light: f32) -> f32 {
    if light <= KNEE {
        return light;
    }
    let above = (light - KNEE) / (1.0 - KNEE);
    let most = (PEAK / WHITE - KNEE) / (1.0 - KNEE);
    let share = above * (1.0 + above / (most * most)) / (1.0 + above);
    KNEE + (1.0 - KNEE) * share.min(1.0)
}

/// Converts pictures of one kind of light.
pub(super) struct ToneMap {
    light: Light,
    /// Linear light by level.
    linear: Vec<f32>,
    /// Factor from scene to display by the square root of luminance.
    displayed: Vec<f32>,
    /// Level of ordinary video by the square root of light.
    coded: Vec<u8>,
}

impl fmt::Debug for ToneMap {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(to, "ToneMap({:?})", self.light)
    }
}

/// The entry for `light`, from 0 to 1, of a table over its square root.
fn step(light: f32) -> usize {
    ((light.sqrt() * (STEPS - 1) as f32 + 0.5) as usize).min(STEPS - 1)
}

impl ToneMap {
    pub(super) fn new(light: Light) -> Self {
        let share = |step: usize| (step as f32 / (STEPS - 1) as f32).powi(2);
        let coded = |step: usize| (255.0 * share(step).powf(1.0 / GAMMA)).round() as u8;
        Self {
            light,
            linear: (0..LEVELS)
                .map(|level| light.transfer.linear(level as f32 / (LEVELS - 1) as f32))
                .collect(),
            displayed: (0..STEPS)
                .map(|step| light.transfer.displayed(share(step)))
                .collect(),
            coded: (0..STEPS).map(coded).collect(),
        }
    }

    /// The levels of ordinary video, `[height, width, 3]`.
    pub(super) fn apply(&self, levels: &Levels) -> Vec<u8> {
        match levels {
            Levels::Eight(levels) => {
                self.map(levels.as_chunks().0, |level| usize::from(level) * 257)
            }
            Levels::Sixteen(levels) => self.map(levels.as_chunks().0, usize::from),
        }
    }

    fn map<T: Copy>(&self, pixels: &[[T; 3]], level: impl Fn(T) -> usize) -> Vec<u8> {
        let code = |light: f32| self.coded.get(step(light)).copied().unwrap_or(u8::MAX);
        let map = |pixel: &[T; 3]| self.mapped(pixel.map(&level)).map(code);
        pixels.iter().flat_map(map).collect()
    }

    /// Linear light of BT.709 in shares of white, from levels of 16 bits: on a display, before compression.
    pub(super) fn shown(&self, levels: [usize; 3]) -> [f32; 3] {
        let light = levels.map(|level| self.linear.get(level).copied().unwrap_or(0.0));
        let luminance = dot(self.light.primaries.luminance(), light);
        let factor = self.displayed.get(step(luminance)).copied().unwrap_or(1.0);
        self.light
            .primaries
            .to_bt709()
            .map(|row| factor * dot(row, light))
    }

    fn mapped(&self, levels: [usize; 3]) -> [f32; 3] {
        let mut light = self.shown(levels);
        // A colour outside of BT.709 goes towards grey of its luminance until it is inside, which keeps its hue.
        let least = light.iter().copied().fold(f32::MAX, f32::min);
        if least < 0.0 {
            let grey = dot(Primaries::Bt709.luminance(), light).max(0.0);
            let share = grey / (grey - least).max(1e-9);
            light = light.map(|it| (grey + (it - grey) * share).max(0.0));
        }
        // One factor for all three keeps the hue of bright colours.
        let most = light.iter().copied().fold(0.0, f32::max);
        if most > KNEE {
            let factor = compressed(most) / most;
            light = light.map(|it| it * factor);
        }
        light
    }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    const HLG: Light = Light {
        transfer: Transfer::Hlg,
        primaries: Primaries::Bt2020,
    };
    const PQ: Light = Light {
        transfer: Transfer::Pq,
        primaries: Primaries::Bt2020,
    };

    fn grey(light: Light, level: f32) -> u8 {
        let level = (level * 65_535.0).round() as u16;
        let mapped = ToneMap::new(light).apply(&Levels::Sixteen(vec![level; 3]));
        // Rows of a matrix do not sum to 1 exactly.
        let [red, green, blue] = mapped[..] else {
            panic!("{mapped:?}")
        };
        assert!(red.abs_diff(green) <= 1 && blue.abs_diff(green) <= 1);
        green
    }

    #[test]
    fn reference_white_is_white_and_greys_are_greys() {
        // BT.2408, table 1: levels of diffuse white and of the 18 % grey card (26 cd/m2), by HLG and PQ.
        for (light, white, card) in [(HLG, 0.75, 0.38), (PQ, 0.58, 0.38)] {
            assert!((246..=248).contains(&grey(light, white)), "{light}");
            let expected = 255.0 * (26.0f32 / 203.0).powf(1.0 / GAMMA);
            let off = f32::from(grey(light, card)) - expected;
            assert!(off.abs() < 4.0, "{light}: {off}");
            assert_eq!(grey(light, 0.0), 0);
        }
        assert_eq!(grey(HLG, 1.0), 255);
        assert_eq!(grey(PQ, 0.7518), 255, "1000 cd/m2");
    }

    #[test]
    fn brighter_light_is_brighter() {
        let light: Vec<f32> = (0..500).map(|it| it as f32 / 100.0).collect();
        let levels: Vec<f32> = light.iter().map(|it| compressed(*it)).collect();
        assert!(levels.is_sorted_by(|a, b| a < b || *b >= 1.0));
        assert_eq!(compressed(KNEE), KNEE);
        assert!((compressed(PEAK / WHITE) - 1.0).abs() < 1e-6);
        // No kink at the knee.
        assert!((compressed(KNEE + 1e-3) - KNEE - 1e-3).abs() < 1e-5);
    }

    #[test]
    fn wide_colours_come_to_bt709() {
        let map = |light: Light, levels: [u8; 3]| {
            ToneMap::new(light).apply(&Levels::Eight(levels.to_vec()))
        };
        let p3 = Light {
            transfer: Transfer::Sdr,
            primaries: Primaries::DisplayP3,
        };
        assert_eq!(map(p3, [128, 128, 128]), [128; 3]);
        let skin = map(p3, [190, 150, 130]);
        assert!(skin[0] > 190 && skin[2] < 130, "{skin:?}");
        // Outside of BT.709: as saturated as it can be, of the same hue.
        let green = map(p3, [0, 200, 0]);
        assert!(green[0] == 0 || green[2] == 0, "{green:?}");
        assert!(green[1] > 190, "{green:?}");
    }
}
