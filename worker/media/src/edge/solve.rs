//! Coverage from colours, the compositing equation solved for α.

use super::background::Plate;
use super::band::{Band, DIRECTIONS, Zone};
use super::extrapolate::Continued;
use super::{KnownBackground, Rgb};

/// A foreground and a background this far apart tell α well, levels (the length of the difference of colours).
const APART: f32 = 50.0;
/// A colour this far from the line between both is of something else, levels.
const OFF_LINE: f32 = 25.0;
/// Difference from a known background below which a pixel is it, and above which it is not, levels.
const DIFFERENT: [f32; 2] = [18.0, 45.0];
/// Weight of the given mask beside the colours, at its edge and as far from it as a pixel is uncertain.
const GIVEN: [f32; 2] = [0.1, 0.6];
/// The same values for a background that is not known but extrapolated.
const GIVEN_UNKNOWN: [f32; 2] = [0.3, 1.5];
/// A colour is clear if its weight is at least this.
const CLEAR: f32 = 0.7;
/// Squared difference of a coarse mask from what clear colours say. Exact masks have 0.006 to 0.015, those of the pose
/// network mostly 0.04 to 0.13.
const COARSE: f32 = 0.04;
/// Largest factor of a good mask's weight.
const MOST_TRUST: f32 = 30.0;
/// Weight of a neighbour of the same colour.
const NEIGHBOUR: f32 = 1.5;
/// Difference at which that weight has fallen by e^(−1/2), levels.
const NEIGHBOUR_COLOUR: f32 = 12.0;
/// A colour outside of the band that is this close is the pixel's background, levels.
const SAMPLE: f32 = 24.0;
/// Rounds of smoothing.
const ROUNDS: usize = 12;
/// One pixel in this number tells the exposure.
const EXPOSURE_STEP: usize = 7;
/// A shadow leaves at least this share of a background's light.
const SHADOW: f32 = 0.5;
/// A shadow's colour is within this distance of the background's direction, levels.
const SHADOW_COLOUR: f32 = 12.0;
/// What remains of the colours' weight in a shadow.
const SHADOW_WEIGHT: f32 = 0.2;

/// The coverage that a pixel's colour suggests.
#[derive(Clone, Copy)]
struct AlphaEvidence {
    alpha: f32,
    /// Weight of `alpha`, 0 to 1.
    weight: f32,
    /// The mask's value, and its weight.
    given: f32,
    given_weight: f32,
}

/// A pixel of the band whose coverage was solved.
pub(super) struct Solved {
    /// Index in the picture.
    pub pixel: usize,
    /// Coverage, 0 to 1.
    pub alpha: f32,
    /// The person's share of its colour, premultiplied by the coverage.
    pub own: [u8; 3],
}

/// The uncertain pixels of the `band` in a picture of `pixels`, solved.
pub(super) fn solve(
    band: &Band,
    pixels: &[[u8; 3]],
    mask: &[u8],
    known: &KnownBackground,
) -> Vec<Solved> {
    let behind = known.behind(pixels, &band.background(pixels.len()));
    let gain = exposure(band, pixels, &behind);
    let plate = |pixel: usize| -> Option<Rgb> {
        let colour = behind.at(pixel)?;
        Some(std::array::from_fn(|c| gain[c] * f32::from(colour[c])))
    };
    let foreground = Continued::of(band, |at, pixel| {
        (band.zones[at] == Zone::Foreground).then(|| pixels[pixel].map(f32::from))
    });
    let around = Continued::of(band, |at, pixel| match band.zones[at] {
        Zone::Background => Some(pixels[pixel].map(f32::from)),
        Zone::Uncertain | Zone::Foreground => plate(pixel),
    });
    let depths = band.depths(mask);
    let uncertain: Vec<usize> = (0..band.zones.len())
        .filter(|at| band.zones[*at] == Zone::Uncertain)
        .collect();
    let colours: Vec<Rgb> = uncertain
        .iter()
        .map(|&at| pixels[band.pixel(at)].map(f32::from))
        .collect();
    // A camera on a stand trembles, so a neighbour's background may be a pixel's.
    let behind_near = |at: usize| {
        let behind = |near| plate(band.pixel(near)).unwrap_or_else(|| around.at(band, near));
        band.cross(at).map(behind)
    };
    let mut backgrounds: Vec<Rgb> = (uncertain.iter().zip(&colours))
        .map(|(&at, &colour)| nearest(colour, behind_near(at)))
        .collect();
    // A floor's shadow and a line of the wall go on beyond the band, in this frame's light.
    for direction in DIRECTIONS {
        let outward = band.outward(direction);
        for ((at, &colour), background) in uncertain.iter().zip(&colours).zip(&mut backgrounds) {
            let beyond = outward[*at].map(|it| pixels[band.pixel(it as usize)].map(f32::from));
            if let Some(it) = beyond.filter(|it| squared(minus(colour, *it)) < SAMPLE * SAMPLE) {
                *background = nearest(colour, [*background, it]);
            }
        }
    }
    let mut said: Vec<AlphaEvidence> = (uncertain.iter().zip(&colours).zip(&backgrounds))
        .map(|((&at, &colour), &background)| {
            let pixel = band.pixel(at);
            let given = MaskEvidence {
                alpha: f32::from(mask[pixel]) / 255.0,
                depth: depths.at(band, at),
            };
            let known = behind.at(pixel).is_some();
            says(colour, foreground.at(band, at), background, given, known)
        })
        .collect();
    let trust = trust(&said);
    said.iter_mut().for_each(|it| it.given_weight *= trust);
    let alphas = smoothed(band, &uncertain, &colours, &said);
    let mut solved = Vec::with_capacity(uncertain.len());
    for (index, (at, alpha)) in uncertain.into_iter().zip(alphas).enumerate() {
        let (colour, background) = (colours[index], backgrounds[index]);
        // α F = I − (1 − α) B
        let own = |c: usize| colour[c] - (1.0 - alpha) * background[c];
        solved.push(Solved {
            pixel: band.pixel(at),
            alpha,
            own: std::array::from_fn(|c| (own(c).clamp(0.0, 255.0 * alpha) + 0.5) as u8),
        });
    }
    solved
}

/// The one of `candidates` that is most like `colour`.
fn nearest<const N: usize>(colour: Rgb, candidates: [Rgb; N]) -> Rgb {
    let mut best = candidates[0];
    for it in candidates {
        if squared(minus(colour, it)) < squared(minus(colour, best)) {
            best = it;
        }
    }
    best
}

impl AlphaEvidence {
    /// The mean of both by weight.
    fn mean(&self) -> f32 {
        (self.weight * self.alpha + self.given_weight * self.given)
            / (self.weight + self.given_weight)
    }
}

/// The mean brightness of each channel over that of the known background, outside of the person.
fn exposure(band: &Band, pixels: &[[u8; 3]], behind: &Plate) -> Rgb {
    let mut sums = [[0.0f64; 2]; 3];
    for at in (0..band.zones.len()).step_by(EXPOSURE_STEP) {
        let pixel = band.pixel(at);
        let plate = behind.at(pixel);
        if let (Some(plate), Zone::Background) = (plate, band.zones[at]) {
            for channel in 0..3 {
                sums[channel][0] += f64::from(pixels[pixel][channel]);
                sums[channel][1] += f64::from(plate[channel]);
            }
        }
    }
    // What is behind the person may have changed; light changes less.
    sums.map(|[seen, plate]| ((seen + 1.0) / (plate + 1.0)).clamp(0.8, 1.25) as f32)
}

/// Factor of the mask's weight: where colours are clear, a good mask says the same.
fn trust(said: &[AlphaEvidence]) -> f32 {
    let (mut sum, mut count) = (0.0, 0.0);
    for it in said.iter().filter(|it| it.weight > CLEAR) {
        sum += (it.alpha - it.given).powi(2);
        count += 1.0;
    }
    if count == 0.0 {
        return 1.0;
    }
    let variance = (sum / count).max(1e-4);
    (COARSE / variance).powi(2).clamp(1.0, MOST_TRUST)
}

/// The coverage that the mask has at a pixel.
struct MaskEvidence {
    alpha: f32,
    /// Distance from the mask's edge, 0 to 1 where the band ends.
    depth: f32,
}

fn says(
    colour: Rgb,
    foreground: Rgb,
    background: Rgb,
    given: MaskEvidence,
    known: bool,
) -> AlphaEvidence {
    let [edge, end] = if known { GIVEN } else { GIVEN_UNKNOWN };
    let between = minus(foreground, background);
    let own = minus(colour, background);
    let square = squared(between);
    let mut alpha = (dot(own, between) / square.max(1.0)).clamp(0.0, 1.0);
    let off = minus(own, between.map(|it| alpha * it));
    let off = squared(off);
    let mut weight = square / (square + APART * APART);
    if known {
        // What differs from a known background covers it, whatever its colour.
        let difference = squared(own).sqrt();
        let [low, high] = DIFFERENT;
        let differs = ((difference - low) / (high - low)).clamp(0.0, 1.0);
        let other = 1.0 - (-off / (2.0 * OFF_LINE * OFF_LINE)).exp();
        alpha += other * (differs - alpha).max(0.0);
        weight = weight.max(other * differs);
        if shadowed(colour, background) {
            weight *= SHADOW_WEIGHT;
        }
    } else {
        weight *= (-off / (2.0 * OFF_LINE * OFF_LINE)).exp();
    }
    AlphaEvidence {
        alpha,
        weight,
        given: given.alpha,
        given_weight: edge + (end - edge) * given.depth * given.depth,
    }
}

/// Whether a colour is that of the background in less light.
fn shadowed(colour: Rgb, background: Rgb) -> bool {
    let share = dot(colour, background) / squared(background).max(1.0);
    let off = minus(colour, background.map(|it| share * it));
    (SHADOW..0.93).contains(&share) && squared(off) < SHADOW_COLOUR * SHADOW_COLOUR
}

/// Coverage of the `uncertain` pixels that agrees with what they say and with neighbours of the same colour (Jacobi's
/// iterations on the weighted least squares).
fn smoothed(band: &Band, uncertain: &[usize], colours: &[Rgb], said: &[AlphaEvidence]) -> Vec<f32> {
    let mut place = vec![u32::MAX; band.zones.len()];
    for (index, &at) in uncertain.iter().enumerate() {
        place[at] = index as u32;
    }
    let links: Vec<[(u32, f32); 4]> = (uncertain.iter().zip(colours))
        .enumerate()
        .map(|(index, (&at, colour))| {
            let [_, neighbours @ ..] = band.cross(at);
            neighbours.map(|near| match place[near] {
                u32::MAX => (index as u32, 0.0),
                other => {
                    let off = minus(*colour, colours[other as usize]);
                    let scale = 2.0 * NEIGHBOUR_COLOUR * NEIGHBOUR_COLOUR;
                    (other, NEIGHBOUR * (-squared(off) / scale).exp())
                }
            })
        })
        .collect();
    let mut alphas: Vec<f32> = said.iter().map(AlphaEvidence::mean).collect();
    let mut next = alphas.clone();
    for _ in 0..ROUNDS {
        for ((it, links), next) in said.iter().zip(&links).zip(&mut next) {
            let mut weight = it.weight + it.given_weight;
            let mut sum = it.weight * it.alpha + it.given_weight * it.given;
            for &(other, link) in links {
                sum += link * alphas[other as usize];
                weight += link;
            }
            *next = sum / weight;
        }
        std::mem::swap(&mut alphas, &mut next);
    }
    alphas
}

fn minus(a: Rgb, b: Rgb) -> Rgb {
    std::array::from_fn(|c| a[c] - b[c])
}

fn squared(a: Rgb) -> f32 {
    dot(a, a)
}

fn dot(a: Rgb, b: Rgb) -> f32 {
    (0..3).map(|c| a[c] * b[c]).sum()
}
