//! Splats in 36 bytes each, 8 more for pose blend shapes, 9 or 24 more for view-dependent colours, and a bit where some are
//! guessed. In a box of a few metres, 16 bits are exact to some hundredths of a millimetre.

use yoto_avatar::render::SkinnedSplat;
use yoto_ops::splat::harmonics::count;

/// Range of the logarithms of standard deviations in metres: 1 µm to 7 m.
pub(super) const DEVIATIONS: [f32; 2] = [-14.0, 2.0];
/// Largest absolute value of a coefficient of view-dependent colour.
pub(super) const HARMONIC: f32 = 1.0;
/// Range of colours without light.
pub(super) const COLOURS: [f32; 2] = [-1.0, 3.0];

/// Splats as bytes.
pub(super) struct Packed {
    /// Little-endian. For each splat: numbers of 16 bits, 3 for the mean, 4 for the rotation, 3 for the deviations, one
    /// for the opacity and 3 for the colour; then 4 joints and 4 skinning weights of 8 bits.
    pub bytes: Vec<u8>,
    /// `[N, K, 3]`: coefficients of the harmonics in 8 bits; 128 means 0.
    pub harmonics: Vec<u8>,
    /// A bit per splat, the lowest of a byte first: whether it is guessed. Empty if none is.
    pub guessed: Vec<u8>,
    /// Corners of the box of the means, metres.
    pub bounds: [[f32; 3]; 2],
}

/// Packs `splats` with the harmonics up to `degree`.
pub(super) fn pack(splats: &[SkinnedSplat], degree: usize) -> Packed {
    let corner = |start: f32, choose: fn(f32, f32) -> f32| -> [f32; 3] {
        std::array::from_fn(|a| splats.iter().map(|splat| splat.mean[a]).fold(start, choose))
    };
    // Without splats the bounds would be infinite.
    let bounds = match splats.is_empty() {
        true => [[0.0; 3]; 2],
        false => [
            corner(f32::INFINITY, f32::min),
            corner(f32::NEG_INFINITY, f32::max),
        ],
    };
    let [low, high] = bounds;
    let mut bytes = Vec::with_capacity(36 * splats.len());
    for splat in splats {
        let mut numbers = Vec::with_capacity(14);
        numbers.extend((0..3).map(|a| whole(splat.mean[a], [low[a], high[a]])));
        numbers.extend(splat.rotation.map(|q| whole(q, [-1.0, 1.0])));
        numbers.extend(splat.deviations.map(|d| whole(d.ln(), DEVIATIONS)));
        numbers.push(whole(splat.opacity, [0.0, 1.0]));
        numbers.extend(splat.colour.map(|c| whole(c, COLOURS)));
        bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        // A skeleton has at most 256 joints.
        bytes.extend(splat.bones.map(|(bone, _)| bone as u8));
        bytes.extend(splat.bones.map(|(_, share)| (255.0 * share).round() as u8));
    }
    let shine = splats.iter().flat_map(|splat| {
        let coefficient = |value: &f32| 128 + (127.0 * value / HARMONIC).round() as i8 as i32;
        let own = splat.harmonics[..count(degree)].as_flattened();
        own.iter().map(move |value| coefficient(value) as u8)
    });
    Packed {
        guessed: bits(splats),
        harmonics: shine.collect(),
        bytes,
        bounds,
    }
}

/// `numbers` in 8 bits, 128 for 0, and the largest size among them.
pub(super) fn weights(numbers: &[f32]) -> (Vec<u8>, f32) {
    let sizes = numbers.iter().map(|number| number.abs());
    let most = sizes.fold(f32::MIN_POSITIVE, f32::max);
    let byte = |number: &f32| (128.0 + 127.0 * number / most).round() as u8;
    (numbers.iter().map(byte).collect(), most)
}

/// `numbers`, little-endian.
pub(super) fn floats(numbers: &[f32]) -> Vec<u8> {
    numbers
        .iter()
        .flat_map(|number| number.to_le_bytes())
        .collect()
}

/// A bit per splat, 1 where it is guessed; nothing if none is.
fn bits(splats: &[SkinnedSplat]) -> Vec<u8> {
    let byte = |eight: &[SkinnedSplat]| {
        let each = eight.iter().enumerate();
        each.fold(0, |byte, (at, splat)| byte | u8::from(splat.guessed) << at)
    };
    match splats.iter().any(|splat| splat.guessed) {
        true => splats.chunks(8).map(byte).collect(),
        false => Vec::new(),
    }
}

/// `value` as a share of the range, in parts of 65,535.
fn whole(value: f32, [low, high]: [f32; 2]) -> u16 {
    let width = (high - low).max(f32::MIN_POSITIVE);
    (f32::from(u16::MAX) * ((value - low) / width).clamp(0.0, 1.0)).round() as u16
}
