//! Recognises a video whose declaration of light is wrong, by a picture.
//!
//! Converters pass on declarations with levels that they have already made ordinary. Read as HDR, ordinary levels have colours that no
//! lit surface has, and large areas as bright as lamps. One picture's blocks are looked at, since their means have little noise.
//!
//! The bounds were chosen on nine clips of ordinary video, read as HLG of BT.2020 and converted to it: none of the converted ones has a
//! block beyond them; of those read as HLG, seven pass one. A wrong declaration of dull and dark pictures is therefore not found.

use super::light::{Levels, Light, ToneMap, Transfer};

/// Pixels along a side of a block.
const SIDE: usize = 8;
/// Colours of less light are not judged, share of white: 10 cd/m².
const DARK: f32 = 0.05;
/// Least negative share of a colour by which it is clearly, or just, outside of BT.709.
const CLEARLY_OUTSIDE: f32 = 0.05;
const OUTSIDE: f32 = 0.02;
/// The declaration is wrong if this share of the blocks is clearly outside.
const MANY_OUTSIDE: f32 = 0.01;
/// The declaration is wrong if these shares of the blocks are outside and brighter than lamps.
const SOME_OUTSIDE: f32 = 0.001;
const SOME_BRIGHT: f32 = 0.02;
/// The declaration is wrong if this share of the blocks is at the top of the scale.
const MANY_AT_TOP: f32 = 0.05;

/// Levels, as shares of the highest, that count as brighter than lamps and as the top of the scale.
fn bright(transfer: Transfer) -> [f32; 2] {
    match transfer {
        // 500 and 900 cd/m².
        Transfer::Hlg => [0.9, 0.98],
        // 1500 and 4000 cd/m²: films are graded to 1000 or 4000.
        Transfer::Pq => [0.8, 0.9],
        // The top of ordinary video is white.
        Transfer::Sdr => [2.0, 2.0],
    }
}

/// Whether the levels of a picture, `width` pixels wide, can't be of the `light` that `map` converts.
pub(super) fn is_wrong(map: &ToneMap, light: Light, levels: &Levels, width: usize) -> bool {
    let blocks = match levels {
        Levels::Eight(levels) => blocks(levels.as_chunks().0, width, |it| f32::from(it) * 257.0),
        Levels::Sixteen(levels) => blocks(levels.as_chunks().0, width, f32::from),
    };
    if blocks.is_empty() {
        return false;
    }
    let lowest = |block: &[f32; 3]| {
        let light = map.shown(block.map(|level| level.round() as usize));
        let most = light.iter().copied().fold(0.0, f32::max);
        let least = light.iter().copied().fold(f32::MAX, f32::min);
        if most < DARK { 0.0 } else { least / most }
    };
    let highest = |block: &[f32; 3]| block.iter().copied().fold(0.0, f32::max) / 65_535.0;
    let share = |count: usize| count as f32 / blocks.len() as f32;
    let outside = |by: f32| share(blocks.iter().filter(|block| lowest(block) < -by).count());
    let above = |level: f32| share(blocks.iter().filter(|block| highest(block) > level).count());
    let [lamps, top] = bright(light.transfer);
    outside(CLEARLY_OUTSIDE) >= MANY_OUTSIDE
        || above(top) >= MANY_AT_TOP
        || (outside(OUTSIDE) >= SOME_OUTSIDE && above(lamps) >= SOME_BRIGHT)
}

/// Mean levels of blocks of `pixels`; what is left at the right and at the bottom is not looked at.
fn blocks<T: Copy>(pixels: &[[T; 3]], width: usize, level: impl Fn(T) -> f32) -> Vec<[f32; 3]> {
    let across = width / SIDE;
    let mut blocks = Vec::new();
    for rows in pixels.chunks_exact((width * SIDE).max(1)) {
        let mut sums = vec![[0.0f32; 3]; across];
        for row in rows.chunks_exact(width.max(1)) {
            for (sum, run) in sums.iter_mut().zip(row.chunks_exact(SIDE)) {
                for pixel in run {
                    for (sum, it) in sum.iter_mut().zip(pixel) {
                        *sum += level(*it);
                    }
                }
            }
        }
        blocks.extend(
            sums.iter()
                .map(|sum| sum.map(|it| it / (SIDE * SIDE) as f32)),
        );
    }
    blocks
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::video::light::Primaries;

    /// Whether a picture of stripes, 64 by 32 pixels, is not of the light declared.
    fn wrong(transfer: Transfer, stripes: &[[u8; 3]]) -> bool {
        let light = Light {
            transfer,
            primaries: Primaries::Bt2020,
        };
        let stripe = |x: usize| stripes[x * stripes.len() / 64];
        let levels = (0..64 * 32).flat_map(|at| stripe(at % 64)).collect();
        is_wrong(&ToneMap::new(light), light, &Levels::Eight(levels), 64)
    }

    #[test]
    fn colours_of_no_surface_and_light_of_lamps_everywhere_are_wrong() {
        // Grass, jeans, a white wall: ordinary levels.
        let grass = [[60, 120, 40], [40, 60, 110], [120, 110, 100], [90, 80, 70]];
        assert!(wrong(Transfer::Hlg, &grass));
        let wall = [[252, 252, 250], [90, 80, 70]];
        assert!(wrong(Transfer::Hlg, &wall));
        assert!(wrong(Transfer::Pq, &wall));
        // The same scene as HLG and PQ have it: white at 75 % and 58 %, colours of BT.709 within BT.2020.
        let hlg = [
            [191, 191, 190],
            [109, 119, 86],
            [90, 80, 70],
            [150, 140, 130],
        ];
        assert!(!wrong(Transfer::Hlg, &hlg));
        let pq = [
            [148, 148, 147],
            [109, 119, 86],
            [90, 80, 70],
            [120, 115, 112],
        ];
        assert!(!wrong(Transfer::Pq, &pq));
    }

    #[test]
    fn a_picture_without_a_block_is_as_declared() {
        let light = Light {
            transfer: Transfer::Hlg,
            primaries: Primaries::Bt2020,
        };
        let map = ToneMap::new(light);
        assert!(!is_wrong(&map, light, &Levels::Eight(vec![255; 3]), 1));
        assert!(!is_wrong(&map, light, &Levels::Eight(Vec::new()), 0));
    }
}
